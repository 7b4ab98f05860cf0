//! What can end a worker's attempt at a job, or the worker.
use std::error::Error as _;
use std::path::PathBuf;

use tonic::{Code, Status};
use tonic_types::StatusExt;

/// Result of what workers do.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The lease is no longer this worker's.
    #[error("the lease of the job is lost")]
    LeaseLost,
    /// The server can't be reached at the moment, or is too slow.
    #[error("the server can't be reached: {0}")]
    Unreachable(String),
    /// The server answered with an error.
    #[error("the server refused to {call}: {message} ({code:?})")]
    Refused {
        /// What was asked for.
        call: &'static str,
        /// Its code.
        code: Code,
        /// Its words.
        message: String,
    },
    /// What the server sent is not what it announced, or not what this worker can make sense of.
    #[error("{what}: {reason}")]
    Damaged {
        /// What was sent.
        what: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The job can't be carried out as it is.
    #[error("{0}")]
    BadJob(String),
    /// The marked scene misses its target.
    #[error("target missed: {0}")]
    TargetMissed(String),
    /// Reading or writing a file of the worker's own failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] guardsplat_engine::Error),
    /// Content credentials can't be made here.
    #[error("content credentials: {0}")]
    Credentials(#[from] crate::credentials_program::Error),
    /// The engine's thread is gone.
    #[error("the engine panicked: {0}")]
    Panicked(String),
    /// The engine was asked to stop and did not.
    #[error("the engine did not stop within {0} s")]
    Stuck(u64),
    /// An option of the worker is not what it must be.
    #[error("{field}: {reason}")]
    BadOption {
        /// The option as the user wrote it.
        field: &'static str,
        /// What is wrong.
        reason: String,
    },
}

impl Error {
    /// What the server's answer to `call` means.
    pub fn of(call: &'static str, status: &Status) -> Self {
        let reason = status.get_details_error_info().map(|info| info.reason);
        match status.code() {
            Code::Aborted if reason.is_none_or(|reason| reason == "LEASE_LOST") => Self::LeaseLost,
            // How connections that break show depends on the moment.
            Code::Unavailable | Code::Unknown | Code::Cancelled | Code::DeadlineExceeded => {
                Self::Unreachable(in_full(status))
            }
            code => Self::Refused {
                call,
                code,
                message: status.message().to_owned(),
            },
        }
    }

    /// An [`Error::Io`] at `path`, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }

    /// Whether the server is there, but says that something is wrong with itself.
    pub fn is_unwell(&self) -> bool {
        matches!(
            self,
            Self::Refused {
                code: Code::Internal | Code::ResourceExhausted,
                ..
            }
        )
    }

    /// Whether the worker can't go on after it: its engine or its device is gone.
    pub fn is_fatal(&self) -> bool {
        use guardsplat_engine::Error as Engine;
        matches!(
            self,
            Self::Panicked(_) | Self::Stuck(_) | Self::Engine(Engine::Device { .. })
        )
    }
}

/// A status' words with the innermost of its causes, which says what happened to the connection.
fn in_full(status: &Status) -> String {
    let words = match status.message() {
        "" => status.code().description(),
        message => message,
    };
    let mut cause = status.source();
    while let Some(inner) = cause.and_then(|error| error.source()) {
        cause = Some(inner);
    }
    match cause.map(ToString::to_string) {
        Some(cause) if !words.contains(&cause) => format!("{words}: {cause}"),
        _ => words.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;
    use tonic_types::ErrorDetails;

    #[test]
    fn answers_are_told_apart() {
        let aborted = |reason: &str| {
            let details = ErrorDetails::with_error_info(reason, "guardsplat", HashMap::new());
            Error::of("report", &Status::with_error_details(Code::Aborted, "gone", details))
        };
        assert!(matches!(aborted("LEASE_LOST"), Error::LeaseLost));
        assert!(matches!(aborted("OTHER"), Error::Refused { .. }));
        assert!(matches!(
            Error::of("report", &Status::aborted("gone")),
            Error::LeaseLost
        ));
        assert!(matches!(
            Error::of("report", &Status::unavailable("later")),
            Error::Unreachable(_)
        ));
        let stopping = Error::of("report", &Status::unavailable("the server is stopping"));
        assert_eq!(
            stopping.to_string(),
            "the server can't be reached: the server is stopping"
        );
        let refused = Error::of("complete the job", &Status::invalid_argument("result: missing"));
        assert_eq!(
            refused.to_string(),
            "the server refused to complete the job: result: missing (InvalidArgument)"
        );
    }
}
