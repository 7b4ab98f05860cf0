//! What can go wrong with credentials.
use std::path::PathBuf;

/// A result of this program.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why something could not be done.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file can't be read or written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A file is not what it must be.
    #[error("{}: {reason}", path.display())]
    File { path: PathBuf, reason: String },
    /// The value of the soft binding is none.
    #[error("--soft-binding: {0}")]
    Value(#[from] guardsplat_soft_binding::Error),
    /// A manifest can't be made.
    #[error("making the manifest: {0}")]
    Manifest(#[source] c2pa::Error),
    /// Certificate and key don't sign.
    #[error("signing with {with}: {source}")]
    Signing { with: String, source: Box<c2pa::Error> },
    /// Nobody can be answered.
    #[error("{0}")]
    Serve(String),
    /// Man pages can't be written.
    #[error("{0}")]
    Packaging(std::io::Error),
    /// JSON can't be written.
    #[error("--json: {0}")]
    Json(serde_json::Error),
}

impl Error {
    /// Reading or writing failed at `path`, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }

    /// `path` is not what it must be.
    pub fn file(path: impl Into<PathBuf>, reason: impl Into<String>) -> Self {
        let (path, reason) = (path.into(), reason.into());
        Self::File { path, reason }
    }
}
