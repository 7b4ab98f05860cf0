//! The program `guardsplat-credentials`: where it is, what comes of running it, and the credentials that it signs.
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output, Stdio};

use guardsplat_engine::message::Key;
use guardsplat_soft_binding::{BindingKey, Value};
use serde::Deserialize;

const NAME: &str = "guardsplat-credentials";

/// Why nothing came of it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// It is not there, or is not to be run.
    #[error(
        "{NAME} can't be run: {0}; it must be in the folder of guardsplat-worker or on the PATH \
         (docs/credentials.md says how it is built)"
    )]
    NotThere(std::io::Error),
    /// It refuses; in its words.
    #[error("{0}")]
    Refused(String),
}

/// Result of running it.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Beside this program, or else wherever the system finds it.
fn program() -> PathBuf {
    let beside = std::env::current_exe().ok().map(|own| own.with_file_name(NAME));
    beside.filter(|path| path.is_file()).unwrap_or_else(|| NAME.into())
}

/// Runs it and hands on what it tells.
///
/// # Errors
/// [`Error::NotThere`].
pub fn run_to_end(arguments: &[OsString]) -> Result<ExitStatus> {
    Command::new(program())
        .args(arguments)
        .status()
        .map_err(Error::NotThere)
}

/// Runs it for what it prints.
fn run_with_output(arguments: &[OsString]) -> Result<String> {
    let Output { status, stdout, stderr } = Command::new(program())
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .map_err(Error::NotThere)?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let text = String::from_utf8_lossy(&stderr);
    let told = text.trim().strip_prefix("error: ").unwrap_or(text.trim());
    Err(Error::Refused(if told.is_empty() {
        format!("{NAME} ended with {status}")
    } else {
        told.to_owned()
    }))
}

/// Fails where it is not there.
///
/// # Errors
/// [`Error::NotThere`], or [`Error::Refused`] where something else has its name.
pub fn check() -> Result<()> {
    run_with_output(&["--version".into()]).map(|_| ())
}

/// The certificate that credentials are signed with; a test certificate unless one is given.
#[derive(Clone, Debug, Default)]
pub struct Certificate {
    /// The certificate and those above it, PEM.
    pub certificate: Option<PathBuf>,
    /// Its private key, PEM.
    pub private_key: Option<PathBuf>,
    /// How that key signs.
    pub algorithm: Option<String>,
}

impl Certificate {
    /// Files that must be readable.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        [&self.certificate, &self.private_key]
            .into_iter()
            .flatten()
            .map(PathBuf::as_path)
    }
}

/// What soft bindings of a key are sealed and opened with.
pub fn binding_key<'a>(key: &'a Key, id: &'a str) -> BindingKey<'a> {
    BindingKey {
        id,
        secret: key.secret.expose(),
    }
}

/// Writes the credentials of a marked scene, and says what the program tells of them. Their names for the files are those
/// of the paths.
///
/// # Errors
/// [`Error`].
pub fn sign(certificate: &Certificate, original: &Path, marked: &Path, output: &Path, value: &Value) -> Result<String> {
    let mut arguments = vec!["sign".into(), original.into(), marked.into(), output.into()];
    arguments.extend(["--soft-binding".into(), value.text().into()]);
    for (flag, path) in [
        ("--certificate", &certificate.certificate),
        ("--private-key", &certificate.private_key),
    ] {
        arguments.extend(path.iter().flat_map(|path| [flag.into(), path.into()]));
    }
    let algorithm = certificate.algorithm.iter();
    arguments.extend(algorithm.flat_map(|name| ["--algorithm".into(), name.into()]));
    run_with_output(&arguments)
}

/// What it tells of the marks that a sidecar names.
#[derive(Deserialize)]
pub struct Named {
    /// The sidecar.
    pub path: PathBuf,
    /// The identifier of the active manifest.
    pub manifest: Option<String>,
    /// Whether it is as it was signed.
    pub intact: bool,
    /// Values of soft bindings.
    pub marks: Vec<String>,
    /// Why it is not intact.
    pub reason: Option<String>,
}

/// Reads which marks sidecars name.
///
/// # Errors
/// [`Error`].
pub fn marks(sidecars: &[PathBuf]) -> Result<Vec<Named>> {
    let mut named = Vec::new();
    // As many as fit on a command line.
    for some in sidecars.chunks(256) {
        let arguments: Vec<_> = std::iter::once("marks".into())
            .chain(some.iter().map(Into::into))
            .collect();
        let told = run_with_output(&arguments)?;
        let read = serde_json::from_str::<Vec<Named>>(&told);
        named.extend(read.map_err(|error| Error::Refused(format!("{NAME} marks: {error}")))?);
    }
    Ok(named)
}
