//! Everything that can go wrong with scene files, by what happened.
use std::path::{Path, PathBuf};

/// Result of operations on scene files.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen; texts name the field, the row and the limit.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Reading or writing a file failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file is not a scene we can read, or cannot hold what is to be written.
    #[error("{}: {reason}", path.display())]
    BadScene {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the field, the row and the limit.
        reason: String,
    },
    /// What is in the file does not fit into the memory that there is for it.
    #[error("{}: takes more than the {memory} bytes of memory that there are for it", path.display())]
    DoesNotFit {
        /// The file.
        path: PathBuf,
        /// Bytes that there are for it.
        memory: u64,
    },
}

impl Error {
    /// An [`Error::Io`] at `path`, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }
}

/// What a file is said not to be that begins like none of the formats. What follows says why it is no .splat either,
/// a format whose files may begin in any way.
pub(crate) const UNKNOWN: &str =
    "not a scene: neither a PLY, plain or compressed, nor an SPZ, a SOG, a glTF, a .ksplat or a .splat, since ";

pub(crate) fn bad(path: &Path, reason: String) -> Error {
    Error::BadScene {
        path: path.into(),
        reason,
    }
}
