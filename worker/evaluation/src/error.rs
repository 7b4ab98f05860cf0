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
}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
