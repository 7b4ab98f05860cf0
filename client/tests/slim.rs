//! Dependencies point one way: what computes on an accelerator is not in the trees of client and server, and nothing of a
//! service is in the engine's.
use std::process::Command;

/// Packages that only what computes may need.
const HEAVY: [&str; 7] = ["burn", "cubecl", "wgpu", "naga", "ash", "guardsplat-engine", "cudarc"];

/// Names of all packages that `package` is built from.
fn dependencies(package: &str) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--package",
            package,
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .filter_map(|line| line.split_whitespace().next())
        .map(str::to_owned)
        .collect()
}

/// Those of them that compute.
fn heavy(dependencies: &[String]) -> Vec<&String> {
    let is = |name: &str, heavy: &str| name == heavy || name.starts_with(&format!("{heavy}-"));
    dependencies
        .iter()
        .filter(|name| HEAVY.iter().any(|heavy| is(name, heavy)))
        .collect()
}

#[test]
fn the_client_is_slim() {
    let found = dependencies("guardsplat-client");
    assert!(found.iter().any(|name| name == "tonic"));
    assert_eq!(heavy(&found), Vec::<&String>::new());
}

#[test]
fn the_server_is_slim() {
    let found = dependencies("guardsplat-server");
    assert!(found.iter().any(|name| name == "tonic"));
    assert_eq!(heavy(&found), Vec::<&String>::new());
}

#[test]
fn the_worker_would_be_noticed() {
    let found = dependencies("guardsplat-worker");
    for name in ["burn", "cubecl", "wgpu", "guardsplat-engine"] {
        assert!(heavy(&found).iter().any(|found| *found == name), "{name}");
    }
}

/// Packages of services and command lines.
const OF_SERVICES: [&str; 7] = [
    "tonic",
    "prost",
    "tokio",
    "hyper",
    "clap",
    "guardsplat-proto",
    "guardsplat-evaluation",
];

#[test]
fn the_engine_and_what_is_done_with_it_know_no_service() {
    for package in ["guardsplat-engine", "guardsplat-operations", "guardsplat-python"] {
        let found = dependencies(package);
        for name in OF_SERVICES {
            assert!(!found.iter().any(|found| found == name), "{package}: {name}");
        }
    }
}
