//! `jobs` and `artifact`.
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::State;
use serde_json::Value;

use super::fake::{failure, job, send};
use super::run::TestEnvironment;

/// A environment with jobs 1 to 5 of which the odd ones are running.
fn environment() -> TestEnvironment {
    let environment = TestEnvironment::new();
    for n in 1..=5 {
        let name = name(n);
        let state = if n % 2 == 1 { State::Running } else { State::Queued };
        let job = guardsplat_proto::v1::Job {
            name: name.clone(),
            ..job(state)
        };
        environment.fake.state().jobs.insert(name, job);
    }
    environment
}

fn name(n: u32) -> String {
    format!("jobs/00000000-0000-7000-8000-00000000000{n}")
}

fn listed(json: &Value) -> Vec<&str> {
    json["jobs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|job| job["name"].as_str().unwrap())
        .collect()
}

#[test]
fn lists_go_over_pages() {
    let environment = environment();
    let json = environment.run("jobs list --json").json();
    assert_eq!(listed(&json), [5, 4, 3, 2, 1].map(name));
    assert_eq!(json["more"], false);
    let json = environment.run("jobs list --limit 3 --json").json();
    assert_eq!((listed(&json).len(), &json["more"]), (3, &true.into()));
    let json = environment.run("jobs list --state running --json").json();
    assert_eq!(listed(&json), [5, 3, 1].map(name));
    let text = environment.run("jobs list").out;
    assert_eq!(text.lines().count(), 5);
    assert!(
        text.lines()
            .next()
            .unwrap()
            .starts_with(&format!("{}  running", name(5))),
        "{text}"
    );
}

#[test]
fn one_job_is_told_by_name_or_id() {
    let environment = environment();
    let name = name(2);
    for text in [name.as_str(), name.strip_prefix("jobs/").unwrap()] {
        let json = environment.run(&format!("jobs get {text} --json")).json();
        assert_eq!(
            (&json["name"], &json["state"]),
            (&name.clone().into(), &"queued".into())
        );
    }
}

#[test]
fn a_job_is_cancelled() {
    let environment = environment();
    let ran = environment.run(&format!("jobs cancel {} --json", name(1)));
    assert_eq!((ran.code, &ran.json()["state"]), (0, &"cancelled".into()));
    assert_eq!(environment.fake.state().cancelled, [name(1)]);
}

#[test]
fn dead_letters_are_listed_looked_at_and_tried_again() {
    let environment = environment();
    for (n, reason) in [(1, Reason::Internal), (2, Reason::TargetMissed), (4, Reason::Internal)] {
        let mut state = environment.fake.state();
        let job = state.jobs.get_mut(&name(n)).unwrap();
        job.set_state(State::Failed);
        job.failure = Some(guardsplat_proto::v1::Failure {
            reason: reason.into(),
            message: "out of\u{1b}[31m memory".into(),
        });
    }
    assert_eq!(listed(&environment.run("jobs dead --json").json()), [4, 2, 1].map(name));
    assert_eq!(
        listed(&environment.run("jobs dead --reason internal --json").json()),
        [4, 1].map(name)
    );
    let text = environment.run("jobs dead --reason target-missed").out;
    assert!(text.contains("memory (target_missed)"), "{text}");
    // What a worker says moves no terminal.
    assert!(!text.contains('\u{1b}'), "{text}");
    let json = environment.run(&format!("jobs attempts {} --json", name(4))).json();
    let attempt = &json["attempts"][0];
    assert_eq!((&attempt["number"], &attempt["outcome"]), (&1.into(), &"failed".into()));
    assert_eq!(attempt["failure"]["reason"], "internal");
    let text = environment.run(&format!("jobs attempts {}", name(4))).out;
    assert!(text.contains("failed") && text.contains("a worker"), "{text}");
    let ran = environment.run(&format!("jobs requeue {} --json", name(4)));
    assert_eq!((ran.code, &ran.json()["state"]), (0, &"queued".into()));
    assert_eq!(listed(&environment.run("jobs dead --json").json()), [2, 1].map(name));
}

#[test]
fn a_watch_prints_one_line_a_message_and_exits_as_the_job() {
    let environment = environment();
    environment.fake.plan([
        send(job(State::Queued)),
        send(job(State::Running)),
        failure(Reason::Internal, "broken"),
    ]);
    let ran = environment.run(&format!("jobs watch {} --cursor 7 --json", name(1)));
    assert_eq!(ran.code, 1);
    let lines: Vec<Value> = ran
        .out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let states: Vec<&Value> = lines.iter().map(|line| &line["job"]["state"]).collect();
    assert_eq!(states, ["queued", "running", "failed"]);
    assert_eq!(lines[1]["cursor"], "0.1");
    assert_eq!(lines[2]["job"]["failure"]["reason"], "internal");
    assert_eq!(environment.fake.state().watched[0].cursor, "7");
    assert!(ran.err.contains("failed: broken (internal)"), "{}", ran.err);
}

#[test]
fn a_watched_job_that_missed_its_target_exits_with_3() {
    let environment = environment();
    environment.fake.plan([failure(Reason::TargetMissed, "bits 91 %")]);
    let ran = environment.run(&format!("jobs watch {}", name(1)));
    assert_eq!(ran.code, 3, "{}", ran.err);
    environment.fake.plan([send(job(State::Cancelled))]);
    let ran = environment.run(&format!("jobs watch {}", name(1)));
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("was cancelled"), "{}", ran.err);
}

#[test]
fn artifacts_are_put_and_deleted() {
    let environment = TestEnvironment::new();
    environment.file("a.ply", b"ply");
    let json = environment.run("artifact put a.ply --json").json();
    assert_eq!(
        (&json["display_name"], &json["size_bytes"]),
        (&"a.ply".into(), &3.into())
    );
    let name = json["name"].as_str().unwrap();
    let json = environment.run(&format!("artifact delete {name} --json")).json();
    assert_eq!((&json["name"], &json["deleted"]), (&name.into(), &true.into()));
    assert!(environment.fake.state().artifacts.is_empty());
}

#[test]
fn workers_are_listed_with_what_they_have() {
    let environment = TestEnvironment::new();
    let ran = environment.run("worker list");
    assert_eq!(ran.code, 0, "{}", ran.err);
    let lines: Vec<&str> = ran.out.lines().collect();
    assert_eq!(
        lines[0],
        "busy  attempt 2 of jobs/7  last heard of 1970-01-01T00:00:00Z  a GPU, 1.2.3, 3.0 GiB"
    );
    assert!(
        lines[1].starts_with("elsewhere  a job of another project  "),
        "{}",
        lines[1]
    );
    assert!(lines[2].starts_with("idle  waits  "), "{}", lines[2]);
    let json = environment.run("worker list --json").json();
    assert_eq!(
        (&json["workers"][0]["job"], &json["workers"][0]["attempt"]),
        (&"jobs/7".into(), &2.into())
    );
    assert!(
        json["workers"][1]["job"].is_null() && json["workers"][1]["busy"] == true,
        "{json}"
    );
}
