//! What tests install for themselves, below the build's folder, and skip without.
use std::path::PathBuf;
use std::process::Command;

/// A folder for one installation.
pub(crate) fn folder(name: &str) -> Result<PathBuf, String> {
    let programs = crate::program("guardsplat");
    Ok(programs.parent().ok_or("no folder for it")?.join(name))
}

/// Runs a command; says what it printed when it fails.
pub(crate) fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let text = [output.stdout, output.stderr].concat();
    Err(format!("{command:?}: {}", String::from_utf8_lossy(&text)))
}

/// What was wanted, or `None` with a message that a test is skipped; in CI that is a failure.
#[track_caller]
pub(crate) fn or_skip<T>(what: &str, found: Result<T, String>) -> Option<T> {
    match found {
        Ok(found) => Some(found),
        Err(reason) => {
            assert!(std::env::var_os("CI").is_none(), "no {what} for tests: {reason}");
            eprintln!("skipped: no {what} for this test: {reason}");
            None
        }
    }
}
