//! The example script for uploads, as a website would call it.
#![cfg(target_os = "linux")]
use std::path::Path;
use std::process::{Child, Command, Stdio};

use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::Result as Outcome;

use super::fake::{KEY, failure, figures, success};
use super::run::{Ran, TestEnvironment, finish};

fn start(environment: &TestEnvironment, asset: &str, settings: &[(&str, &str)]) -> Child {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/hooks/upload.sh");
    let client = Path::new(env!("CARGO_BIN_EXE_guardsplat")).parent().unwrap();
    let path = format!("{}:{}", client.display(), std::env::var("PATH").unwrap());
    let mut command = Command::new("bash");
    command
        .arg(script)
        .args([asset, "in.ply", "out.ply", "c0ffee42"])
        .current_dir(environment.folder.path())
        .env("PATH", path)
        .env("GUARDSPLAT_SERVER", environment.fake.url())
        .env("GUARDSPLAT_KEY", KEY)
        .envs(settings.iter().copied())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().unwrap()
}

fn call(environment: &TestEnvironment, asset: &str, settings: &[(&str, &str)]) -> Ran {
    finish(start(environment, asset, settings))
}

fn environment() -> TestEnvironment {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    environment
}

fn plan_success(environment: &TestEnvironment) {
    let marked = environment.fake.store("marked.ply", b"marked");
    environment
        .fake
        .plan([success(Outcome::EmbedResult(figures(&marked, "")))]);
}

#[test]
fn called_twice_it_marks_once_and_keeps_one_copy() {
    let environment = environment();
    plan_success(&environment);
    plan_success(&environment);
    let both = [start(&environment, "asset 7", &[]), start(&environment, "asset 7", &[])].map(finish);
    for ran in both {
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    assert_eq!(std::fs::read(environment.path("out.ply")).unwrap(), b"marked");
    let report = std::fs::read_to_string(environment.path("out.ply.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["written"], true);
    let state = environment.fake.state();
    // Both send the scene; whoever comes second finds the other's job, and deletes what it sent.
    assert_eq!((state.uploads, state.jobs.len(), state.created.len()), (2, 1, 2));
    let job = state.jobs.values().next().unwrap();
    assert_eq!(state.deleted.len(), 1);
    assert_eq!(state.content(job).len(), 1, "the scene of the job is kept");
    assert_eq!(state.created[0].request_id, state.created[1].request_id);
    let id = uuid::Uuid::try_parse(&state.created[0].request_id).unwrap();
    assert_eq!(id.get_version_num(), 8);
}

#[test]
fn other_assets_and_other_tries_are_other_requests() {
    let environment = environment();
    for (asset, settings) in [("7", &[][..]), ("8", &[]), ("7", &[("GUARDSPLAT_HOOK_TRY", "2")])] {
        plan_success(&environment);
        let ran = call(&environment, asset, settings);
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    assert_eq!(environment.fake.state().jobs.len(), 3);
}

#[test]
fn its_exit_code_is_the_client_s() {
    let environment = environment();
    environment.fake.plan([failure(Reason::TargetMissed, "bits 91 %")]);
    let ran = call(&environment, "7", &[]);
    assert_eq!(ran.code, 3, "{}", ran.err);
    assert!(!environment.path("out.ply").exists() && environment.path("out.ply.json").exists());
}

#[test]
fn one_name_with_other_bytes_is_refused() {
    let environment = environment();
    plan_success(&environment);
    assert_eq!(call(&environment, "7", &[]).code, 0);
    environment.file("in.ply", b"ply of another");
    let ran = call(&environment, "7", &[]);
    assert_eq!(ran.code, 1);
    let report = std::fs::read_to_string(environment.path("out.ply.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["error"]["reason"], "REQUEST_ID_REUSED");
    assert!(ran.err.contains("sent before with other bytes"), "{}", ran.err);
    let state = environment.fake.state();
    assert_eq!((state.jobs.len(), state.deleted.len()), (1, 1));
}

#[test]
fn it_leaves_nothing_but_what_it_promises() {
    let environment = environment();
    plan_success(&environment);
    assert_eq!(call(&environment, "-7", &[]).code, 0);
    assert_eq!(environment.files(), ["in.ply", "out.ply", "out.ply.json"]);
}
