//! Lost connections: what was begun goes on, and nothing is done twice.
use guardsplat_proto::v1::VerifyResult;
use guardsplat_proto::v1::job::{Result as Outcome, State};
use guardsplat_proto::v1::verify_result::Verdict;
use tonic::Status;

use super::fake::{Fake, Step, figures, job, send, success};
use super::proxy::Proxy;
use super::run::{PICTURE, TestEnvironment, finish, until};

const VERIFY: &str = "verify in.png --key website --message c0ffee42 --json";

fn verified() -> Step {
    let mut result = VerifyResult::default();
    result.set_verdict(Verdict::Match);
    success(Outcome::VerifyResult(result))
}

#[test]
fn a_watch_goes_on_behind_its_last_cursor_when_the_connection_is_cut() {
    let fake = Fake::start();
    let proxy = Proxy::to(fake.address);
    let environment = TestEnvironment::at(fake, proxy.url());
    environment.file("in.png", PICTURE);
    environment
        .fake
        .plan([send(job(State::Queued)), send(job(State::Running)), Step::Hang]);
    environment.fake.plan([verified()]);
    let child = environment.start(VERIFY);
    until("the job is watched", || environment.fake.state().watched.len() == 1);
    // Both messages are on their way; the stream is silent from here on.
    std::thread::sleep(std::time::Duration::from_millis(300));
    proxy.cut();
    let ran = finish(child);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(
        ran.err.contains("the server was lost while following the job"),
        "{}",
        ran.err
    );
    assert!(ran.err.contains("the server is back"), "{}", ran.err);
    let state = environment.fake.state();
    let cursors: Vec<&str> = state.watched.iter().map(|w| w.cursor.as_str()).collect();
    assert_eq!(cursors, ["", "0.1"]);
    assert_eq!(state.created.len(), 1);
}

#[test]
fn a_stream_that_ends_before_the_job_is_opened_again() {
    let environment = TestEnvironment::new();
    environment.file("in.png", PICTURE);
    environment.fake.plan([send(job(State::Running))]);
    environment
        .fake
        .plan([Step::Fail(Status::unavailable("the server is stopping"))]);
    environment.fake.plan([verified()]);
    let ran = environment.run(VERIFY);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let cursors: Vec<String> = environment
        .fake
        .state()
        .watched
        .iter()
        .map(|w| w.cursor.clone())
        .collect();
    assert_eq!(cursors, ["", "0.0", "0.0"]);
}

#[test]
fn a_server_that_stays_away_is_given_up_with_what_to_do() {
    let environment = TestEnvironment::new();
    environment.file("in.png", PICTURE);
    for _ in 0..10 {
        environment.fake.plan([Step::Fail(Status::unavailable("gone"))]);
    }
    let ran = environment.run(&format!("{VERIFY} --timeout 1"));
    assert_eq!(ran.code, 1);
    assert_eq!(ran.json()["error"]["reason"], "connection_lost");
    assert!(ran.err.contains("guardsplat jobs watch jobs/"), "{}", ran.err);
}

#[test]
fn another_kind_of_error_is_not_tried_again() {
    let environment = TestEnvironment::new();
    environment.file("in.png", PICTURE);
    environment.fake.plan([Step::Fail(Status::internal("a bug"))]);
    let ran = environment.run(VERIFY);
    assert_eq!(ran.code, 1);
    assert_eq!(ran.json()["error"]["code"], "INTERNAL");
    assert_eq!(environment.fake.state().watched.len(), 1);
}

#[test]
fn a_job_whose_answer_was_lost_is_not_made_twice() {
    let environment = TestEnvironment::new();
    environment.file("in.png", PICTURE);
    environment.fake.plan([verified()]);
    for _ in 0..2 {
        environment
            .fake
            .state()
            .create_errors
            .push_back(Status::unavailable("lost"));
    }
    let ran = environment.run(VERIFY);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let state = environment.fake.state();
    assert_eq!(state.created.len(), 3);
    assert!(state.created.iter().all(|request| *request == state.created[0]));
    assert_eq!(state.jobs.len(), 1);
}

#[test]
fn an_upload_that_broke_off_is_sent_again() {
    let environment = TestEnvironment::new();
    let picture = [PICTURE, &[3; 500_000]].concat();
    environment.file("in.png", &picture);
    environment.fake.plan([verified()]);
    environment
        .fake
        .state()
        .upload_errors
        .push_back(Status::unavailable("lost"));
    let ran = environment.run(VERIFY);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let state = environment.fake.state();
    assert_eq!(state.uploads, 2);
    assert_eq!(state.artifacts.values().next().unwrap().1, picture);
}

#[test]
fn a_download_goes_on_where_it_broke_off() {
    let environment = TestEnvironment::new();
    let bytes: Vec<u8> = (0..700_000u32).map(|i| (i % 253) as u8).collect();
    let name = environment.fake.store("marked.ply", &bytes);
    environment.fake.state().download_ends.extend([250_000, 0, 123_456]);
    let ran = environment.run(&format!("artifact get {name} -o out.ply --json"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(std::fs::read(environment.path("out.ply")).unwrap(), bytes);
    assert_eq!(environment.fake.state().offsets, [0, 250_000, 250_000, 373_456]);
    let json = ran.json();
    assert_eq!((&json["name"], &json["size_bytes"]), (&name.into(), &700_000.into()));
}

#[test]
fn a_damaged_download_leaves_the_older_file() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    environment.file("out.ply", b"older");
    let marked = environment.fake.store("marked.ply", b"marked");
    environment
        .fake
        .plan([success(Outcome::EmbedResult(figures(&marked, "")))]);
    environment.fake.state().damage = true;
    let ran = environment.run("embed in.ply -o out.ply --key website --message c0ffee42");
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("SHA-256"), "{}", ran.err);
    assert_eq!(std::fs::read(environment.path("out.ply")).unwrap(), b"older");
    assert_eq!(environment.files(), ["in.ply", "out.ply"]);
}
