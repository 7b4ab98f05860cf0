//! Ctrl-C while a job is waited for.
#![cfg(unix)]
use std::process::{Child, Command};

use guardsplat_proto::v1::job::State;

use super::fake::{Step, job, send};
use super::run::{TestEnvironment, finish, until};

fn waiting(options: &str) -> (TestEnvironment, Child) {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    environment.fake.plan([send(job(State::Running)), Step::Hang]);
    let line = format!("embed in.ply -o out.ply --key website --message c0ffee42 --json {options}");
    let child = environment.start(&line);
    until("the job is watched", || !environment.fake.state().watched.is_empty());
    (environment, child)
}

fn interrupt(child: &Child) {
    let status = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn the_job_goes_on_and_how_to_reach_it_is_told() {
    let (environment, child) = waiting("");
    interrupt(&child);
    let ran = finish(child);
    assert_eq!(ran.code, 1, "{}", ran.err);
    let job = environment.fake.state().jobs.keys().next().unwrap().clone();
    assert!(ran.err.contains(&format!("{job} goes on")), "{}", ran.err);
    assert!(
        ran.err.contains(&format!("guardsplat jobs cancel {job}")),
        "{}",
        ran.err
    );
    assert!(ran.err.contains(&format!("guardsplat jobs watch {job}")), "{}", ran.err);
    let error = &ran.json()["error"];
    assert_eq!((&error["reason"], &error["job"]), (&"interrupted".into(), &job.into()));
    assert!(environment.fake.state().cancelled.is_empty());
    assert_eq!(environment.files(), ["in.ply"]);
}

#[test]
fn the_job_is_cancelled_where_that_was_asked_for() {
    let (environment, child) = waiting("--cancel-on-interrupt");
    interrupt(&child);
    let ran = finish(child);
    assert_eq!(ran.code, 1, "{}", ran.err);
    let state = environment.fake.state();
    assert_eq!(state.cancelled, state.jobs.keys().cloned().collect::<Vec<_>>());
    assert!(ran.err.contains("was asked for"), "{}", ran.err);
}
