//! Helpers of the end-to-end tests: the programs, a folder to run them in, and the scenes to run them on.
pub mod backdrops;
pub mod environment;
mod installed;
pub mod memory;
pub mod ply;
pub mod process;
pub mod python;
pub mod readers;
pub mod service;

use std::path::PathBuf;

pub use environment::TestEnvironment;
pub use memory::Footprint;
pub use process::Process;
pub use readers::Reader;
pub use service::Service;

/// A program of the project, from the same build as the tests.
///
/// # Panics
/// When it was not built: Cargo builds binaries of other packages only when all of the workspace is tested.
pub fn program(name: &str) -> PathBuf {
    let running = std::env::current_exe().expect("a running program has a path");
    let mut profile = running.parent().expect("a program lies in a folder");
    // Tests lie in target/PROFILE/deps, binaries in target/PROFILE.
    if profile.ends_with("deps") {
        profile = profile.parent().expect("deps lies in target/PROFILE");
    }
    let program = profile.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    assert!(
        program.is_file(),
        "{} is missing: run all tests of the workspace (cargo test --release --workspace), or build it first \
         (cargo build --release --workspace)",
        program.display()
    );
    program
}

/// The worker's program.
pub fn worker() -> PathBuf {
    program("guardsplat-worker")
}

/// The folder of the CLIP that the worker ships with, or the one that stands in for it.
pub fn shipped_clip() -> PathBuf {
    std::env::var_os("GUARDSPLAT_CLIP").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../crates/engine/models/guardsplat-2"),
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
