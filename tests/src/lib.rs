//! Helpers of the end-to-end tests: the worker's binary, a folder to run it in, and the scenes to run it on.
pub mod bench;
pub mod ply;

use std::path::PathBuf;

pub use bench::Bench;

/// The worker's binary, from the same build as the tests.
///
/// # Panics
/// When it was not built: Cargo builds binaries of other packages only when all of the workspace is tested.
pub fn worker() -> PathBuf {
    // Tests lie in target/PROFILE/deps, binaries in target/PROFILE.
    let test = std::env::current_exe().expect("a running test has a path");
    let profile = test.parent().and_then(|deps| deps.parent());
    let worker = profile
        .expect("tests lie in target/PROFILE/deps")
        .join(format!("guardsplat-worker{}", std::env::consts::EXE_SUFFIX));
    assert!(
        worker.is_file(),
        "{} is missing: run all tests of the workspace (cargo test --release --workspace), or build it first \
         (cargo build --release -p guardsplat-worker)",
        worker.display()
    );
    worker
}

/// The folder of the CLIP that the worker ships with, or the one that stands in for it.
pub fn shipped_clip() -> PathBuf {
    std::env::var_os("GUARDSPLAT_CLIP").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../worker/models/guardsplat-clip"),
        PathBuf::from,
    )
}

/// A real scene, or `None` (with a message) where there is none. In CI its absence is a failure.
pub fn real_scene(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("GUARDSPLAT_SCENES").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes"),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.is_file() {
        return Some(path);
    }
    let missing = format!("{} is missing; set GUARDSPLAT_SCENES", path.display());
    assert!(std::env::var_os("CI").is_none(), "{missing}");
    eprintln!("skipped: {missing} to run this test");
    None
}
