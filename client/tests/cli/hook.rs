//! The example script for uploads, as a website would call it.
#![cfg(target_os = "linux")]
use std::path::Path;
use std::process::{Child, Command, Stdio};

use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::Result as Outcome;

use super::fake::{KEY, failure, figures, success};
use super::run::{Bench, Ran, finish};

fn start(bench: &Bench, asset: &str, settings: &[(&str, &str)]) -> Child {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/hooks/upload.sh");
    let client = Path::new(env!("CARGO_BIN_EXE_guardsplat")).parent().unwrap();
    let path = format!("{}:{}", client.display(), std::env::var("PATH").unwrap());
    let mut command = Command::new("bash");
    command
        .arg(script)
        .args([asset, "in.ply", "out.ply", "c0ffee42"])
        .current_dir(bench.folder.path())
        .env("PATH", path)
        .env("GUARDSPLAT_SERVER", bench.fake.url())
        .env("GUARDSPLAT_KEY", KEY)
        .envs(settings.iter().copied())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().unwrap()
}

fn call(bench: &Bench, asset: &str, settings: &[(&str, &str)]) -> Ran {
    finish(start(bench, asset, settings))
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.file("in.ply", b"ply");
    bench
}

fn plan_success(bench: &Bench) {
    let marked = bench.fake.store("marked.ply", b"marked");
    bench.fake.plan([success(Outcome::EmbedResult(figures(&marked, "")))]);
}

#[test]
fn called_twice_it_marks_once_and_keeps_one_copy() {
    let bench = bench();
    plan_success(&bench);
    plan_success(&bench);
    let both = [start(&bench, "asset 7", &[]), start(&bench, "asset 7", &[])].map(finish);
    for ran in both {
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    assert_eq!(std::fs::read(bench.path("out.ply")).unwrap(), b"marked");
    let report = std::fs::read_to_string(bench.path("out.ply.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["written"], true);
    let state = bench.fake.state();
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
    let bench = bench();
    for (asset, settings) in [("7", &[][..]), ("8", &[]), ("7", &[("GUARDSPLAT_HOOK_TRY", "2")])] {
        plan_success(&bench);
        let ran = call(&bench, asset, settings);
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    assert_eq!(bench.fake.state().jobs.len(), 3);
}

#[test]
fn its_exit_code_is_the_client_s() {
    let bench = bench();
    bench.fake.plan([failure(Reason::TargetMissed, "bits 91 %")]);
    let ran = call(&bench, "7", &[]);
    assert_eq!(ran.code, 3, "{}", ran.err);
    assert!(!bench.path("out.ply").exists() && bench.path("out.ply.json").exists());
}

#[test]
fn one_name_with_other_bytes_is_refused() {
    let bench = bench();
    plan_success(&bench);
    assert_eq!(call(&bench, "7", &[]).code, 0);
    bench.file("in.ply", b"ply of another");
    let ran = call(&bench, "7", &[]);
    assert_eq!(ran.code, 1);
    let report = std::fs::read_to_string(bench.path("out.ply.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["error"]["reason"], "REQUEST_ID_REUSED");
    assert!(ran.err.contains("sent before with other bytes"), "{}", ran.err);
    let state = bench.fake.state();
    assert_eq!((state.jobs.len(), state.deleted.len()), (1, 1));
}

#[test]
fn it_leaves_nothing_but_what_it_promises() {
    let bench = bench();
    plan_success(&bench);
    assert_eq!(call(&bench, "-7", &[]).code, 0);
    assert_eq!(bench.files(), ["in.ply", "out.ply", "out.ply.json"]);
}
