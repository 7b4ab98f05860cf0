//! The program `guardsplat-credentials`: where it is, and what comes of running it.
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use crate::cli::Exit;
use crate::error::{Error, Result};

const NAME: &str = "guardsplat-credentials";

/// Beside this program, or else wherever the system finds it.
fn program() -> PathBuf {
    let beside = std::env::current_exe().ok().map(|own| own.with_file_name(NAME));
    beside.filter(|path| path.is_file()).unwrap_or_else(|| NAME.into())
}

fn not_there(error: &std::io::Error) -> Error {
    Error::Credentials(format!(
        "{NAME} can't be run: {error}; it must be in the folder of guardsplat-worker or on the PATH \
         (docs/credentials.md says how it is built)"
    ))
}

/// Runs it and hands on what it tells; the exit codes are the same.
pub fn run_to_end(arguments: &[OsString]) -> Result<Exit> {
    let status = Command::new(program())
        .args(arguments)
        .status()
        .map_err(|error| not_there(&error))?;
    Ok(match status.code() {
        Some(0) => Exit::Done,
        Some(2) => Exit::NoMatch,
        Some(3) => Exit::Inconclusive,
        _ => Exit::Failed,
    })
}

/// Runs it for what it prints.
pub fn run_with_output(arguments: &[OsString]) -> Result<String> {
    let Output { status, stdout, stderr } = Command::new(program())
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| not_there(&error))?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let text = String::from_utf8_lossy(&stderr);
    let told = text.trim().strip_prefix("error: ").unwrap_or(text.trim());
    Err(Error::Credentials(if told.is_empty() {
        format!("{NAME} ended with {status}")
    } else {
        told.to_owned()
    }))
}
