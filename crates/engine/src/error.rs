//! Everything that can go wrong in the engine, by what happened.
use std::path::PathBuf;

use crate::memory::Bytes;

/// Result of engine operations.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen; texts name the field, the row and the limit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing a file failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The scene file is not a scene we can read.
    #[error("{}: {reason}", path.display())]
    BadScene {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the field, the row and the limit.
        reason: String,
    },
    /// A camera file is not one we can read.
    #[error("{}: {reason}", path.display())]
    BadCameras {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A picture could not be read or written.
    #[error("{}: {reason}", path.display())]
    BadPicture {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Model weights or their configuration do not fit.
    #[error("model {name}: {reason}")]
    BadModel {
        /// The model's name or file.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A key file is damaged, or belongs to something else.
    #[error("key {}: {reason}", path.display())]
    BadKey {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// An option has a value outside its limits.
    #[error("{field}: {reason}")]
    BadOption {
        /// The option as the user wrote it.
        field: &'static str,
        /// What is wrong, with the limit.
        reason: String,
    },
    /// The job takes more memory than there is.
    #[error("the scene does not fit: {reason}")]
    DoesNotFit {
        /// What is needed and what there is, in numbers.
        reason: String,
    },
    /// The compute device is missing or failed.
    #[error("device {device}: {reason}")]
    Device {
        /// Its name.
        device: String,
        /// What happened.
        reason: String,
    },
    /// A term of the loss stopped being a number.
    #[error("step {step}: the {term} term is {value}; nothing was written")]
    NotFinite {
        /// The optimiser step.
        step: usize,
        /// Which term.
        term: &'static str,
        /// Its value.
        value: f32,
    },
    /// The convolutional decoder could not be trained or used.
    #[error("convolutional decoder: {0}")]
    Hidden(guardsplat_hidden::Error),
    /// Somebody asked for the end ([`crate::stop::Stop`]).
    #[error("stopped before it was done; nothing was written")]
    Stopped,
}

impl Error {
    /// An [`Error::Io`] at `path`, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }
}

impl From<guardsplat_scene::Error> for Error {
    fn from(error: guardsplat_scene::Error) -> Self {
        use guardsplat_scene::Error as Scene;
        match error {
            Scene::Io { path, source } => Self::Io { path, source },
            Scene::BadScene { path, reason } => Self::BadScene { path, reason },
            // Without the path, which may be a worker's own.
            Scene::DoesNotFit { memory, .. } => Self::DoesNotFit {
                reason: format!(
                    "what is in its file takes more than the {} that are left for it",
                    Bytes(memory)
                ),
            },
        }
    }
}

impl From<guardsplat_codeword::Error> for Error {
    fn from(error: guardsplat_codeword::Error) -> Self {
        use guardsplat_codeword::{Error as Codeword, MAX_BITS};
        let (field, reason) = match error {
            Codeword::Length { bits } => ("bits", format!("{bits} is outside 1 to {MAX_BITS}")),
            Codeword::Digits { reason } => ("message", reason),
            other => ("message", other.to_string()),
        };
        Self::BadOption { field, reason }
    }
}

impl From<guardsplat_hidden::Error> for Error {
    fn from(error: guardsplat_hidden::Error) -> Self {
        use guardsplat_hidden::Error as Hidden;
        match error {
            Hidden::Stopped => Self::Stopped,
            Hidden::OutOfRange {
                field,
                value,
                low,
                high,
            } => Self::BadOption {
                field,
                reason: format!("{value} is outside {low} to {high}"),
            },
            other => Self::Hidden(other),
        }
    }
}
