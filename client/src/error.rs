//! What can go wrong, told to people on standard error and to programs as JSON.
use std::collections::BTreeMap;
use std::error::Error as _;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tonic::Status;

use crate::details::{Details, Violation};
use crate::output::{print_json_line, printable, say};

/// The result of what can go wrong.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a command could not be carried out.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The configuration file can't be used.
    #[error("{}: {reason}", path.display())]
    Settings { path: PathBuf, reason: String },
    /// An option or argument is not what it must be.
    #[error("{field}: {reason}")]
    BadOption { field: &'static str, reason: String },
    /// Man pages can't be written.
    #[error("{source}")]
    Packaging { source: std::io::Error },
    /// A file can't be read or written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// Nobody can be heard.
    #[error("listening on {address}: {source}")]
    Listen {
        address: std::net::SocketAddr,
        source: std::io::Error,
    },
    /// A store did not give an object.
    #[error("{url}: {reason}")]
    Object { url: String, reason: String },
    /// A program that was run for something failed.
    #[error("{program}: {reason}")]
    Program { program: String, reason: String },
    /// The process can't wait for anything.
    #[error("the system refuses what asynchronous work needs: {source}")]
    Runtime { source: std::io::Error },
    /// Nobody answers.
    #[error(
        "no server answers at {url}: {reason}\n  is it running? `guardsplat-server` starts one here; one elsewhere is \
         named by --server, GUARDSPLAT_SERVER or `server` in the configuration file"
    )]
    NoServer { url: String, reason: String },
    /// The server was there, and is lost.
    #[error("the connection to {url} was lost while {doing}, and did not come back within {seconds} s: {reason}{hint}")]
    Lost {
        url: String,
        doing: &'static str,
        seconds: u64,
        reason: String,
        hint: String,
    },
    /// The server refused, or failed.
    #[error("{doing} failed: {}", Details::from(&**status))]
    Refused { doing: &'static str, status: Box<Status> },
    /// The server's answer is not one.
    #[error("the server's answer can't be used: {reason}")]
    Answer { reason: String },
    /// What arrived is not what was stored.
    #[error("{}: {reason}; nothing was written", path.display())]
    Damaged { path: PathBuf, reason: String },
    /// The job failed.
    #[error("{job} failed: {} ({reason})", printable(message))]
    JobFailed {
        job: String,
        reason: String,
        message: String,
    },
    /// Somebody cancelled the job.
    #[error("{job} was cancelled")]
    JobCancelled { job: String },
    /// One that the last line of JSON has said already.
    #[error("{0}")]
    AlreadyReported(Box<Error>),
    /// Ctrl-C.
    #[error("interrupted{after}")]
    Interrupted { job: Option<String>, after: String },
}

/// An error for programs: the only thing in the document.
#[derive(Serialize)]
struct Document {
    error: Report,
}

#[derive(Serialize)]
struct Report {
    message: String,
    /// gRPC's, where the server refused.
    code: Option<String>,
    /// Why, in capitals from the server, and else one of a few words.
    reason: Option<String>,
    field_violations: Vec<Violation>,
    resource: Option<String>,
    /// Figures and names that go with the server's reason, as it spells them.
    metadata: Option<BTreeMap<String, String>>,
    retry_after_seconds: Option<f64>,
    job: Option<String>,
}

impl Error {
    /// Turns an I/O error into one that names the file.
    pub fn io(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Io { path, source }
    }

    /// Tells people, and programs where they asked for it.
    pub fn tell(&self, json: bool) {
        say(&format!("error: {self}"));
        if json && !matches!(self, Self::AlreadyReported(_)) {
            print_json_line(&self.document());
        }
    }

    /// Why, in one word: the server's, in capitals, or one of a few.
    fn word(&self) -> Option<String> {
        match self {
            Self::NoServer { .. } => Some("no_server".into()),
            Self::Lost { .. } => Some("connection_lost".into()),
            Self::JobFailed { reason, .. } => Some(reason.clone()),
            Self::JobCancelled { .. } => Some("cancelled".into()),
            Self::Interrupted { .. } => Some("interrupted".into()),
            Self::Refused { status, .. } => Details::from(&**status).reason,
            _ => None,
        }
    }

    /// Why, in one word, for a trace: also where programs are told more.
    pub fn reason(&self) -> String {
        match self {
            Self::AlreadyReported(error) => error.reason(),
            Self::Refused { status, .. } => self.word().unwrap_or_else(|| Details::from(&**status).code),
            // What OpenTelemetry calls what has no name of its own.
            _ => self.word().unwrap_or_else(|| "_OTHER".into()),
        }
    }

    fn document(&self) -> Document {
        let details = match self {
            Self::Refused { status, .. } => Some(Details::from(&**status)),
            _ => None,
        };
        let job = match self {
            Self::JobFailed { job, .. } | Self::JobCancelled { job } => Some(job.clone()),
            Self::Interrupted { job, .. } => job.clone(),
            _ => None,
        };
        Document {
            error: Report {
                message: match self {
                    Self::JobFailed { message, .. } => message.clone(),
                    _ => details.as_ref().map_or_else(|| self.to_string(), |d| d.message.clone()),
                },
                code: details.as_ref().map(|d| d.code.clone()),
                reason: self.word(),
                field_violations: details.as_ref().map(|d| d.field_violations.clone()).unwrap_or_default(),
                resource: details.as_ref().and_then(|d| d.resource.clone()),
                metadata: details.as_ref().map(|d| d.metadata.clone()),
                retry_after_seconds: details.as_ref().and_then(|d| d.retry_after_seconds),
                job,
            },
        }
    }
}

/// The innermost cause, which says what happened where outer ones say "transport error".
pub fn root_cause(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

/// Why a connection was lost, in short.
pub fn why_lost(status: &Status) -> String {
    match status.source() {
        Some(source) => root_cause(source),
        None => printable(status.message()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_have_code_and_reason_for_programs() {
        let error = Error::Refused {
            doing: "reading the key",
            status: Box::new(Status::not_found("no such key")),
        };
        assert_eq!(error.to_string(), "reading the key failed: no such key (NOT_FOUND)");
        let json = serde_json::to_value(error.document()).unwrap();
        assert_eq!(json["error"]["code"], "NOT_FOUND");
        assert_eq!(json["error"]["message"], "no such key");
        assert!(json["error"]["job"].is_null());
    }

    #[test]
    fn the_innermost_cause_is_told() {
        let inner = std::io::Error::other("refused");
        let error = Error::io("a")(inner);
        assert_eq!(root_cause(&error), "refused");
    }
}
