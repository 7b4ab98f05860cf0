//! What can go wrong while judging marks.
use std::path::PathBuf;

/// What can go wrong while judging marks.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Reading or writing a file failed.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// A number is outside its limits.
    #[error("{field}: {reason}")]
    BadOption {
        /// What it is for.
        field: &'static str,
        /// Value and limits.
        reason: String,
    },
    /// A codec failed.
    #[error("{codec}: {reason}")]
    Codec {
        /// Which.
        codec: &'static str,
        /// Why.
        reason: String,
    },
    /// A file of results is not what was written.
    #[error("{path}: {reason}")]
    BadResults {
        /// The file.
        path: PathBuf,
        /// Line and reason.
        reason: String,
    },
    /// A store is open already, here or in another process.
    #[error("{path}: another process is writing results here")]
    Locked {
        /// The file that is locked.
        path: PathBuf,
    },
    /// A file has no place for a table, or more than one.
    #[error("{path}: {reason}")]
    BadMarkers {
        /// The file.
        path: PathBuf,
        /// Which marker, and what is wrong.
        reason: String,
    },
}

impl Error {
    /// An [`Error::Io`] at `path`, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }
}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
