//! Everything that can go wrong in an offline command: what the engine says, or the judging of marks.
use std::path::PathBuf;

use guardsplat_engine::error::Error as Engine;

/// Result of a command.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per crate that did the work; their texts name the field, the row and the limit.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The engine could not do what was asked for.
    #[error(transparent)]
    Engine(#[from] Engine),
    /// Judging marks failed.
    #[error(transparent)]
    Evaluation(#[from] guardsplat_evaluation::Error),
    /// Content credentials could not be made or read.
    #[error("{0}")]
    Credentials(String),
    /// The program that makes or reads them failed.
    #[error(transparent)]
    CredentialsProgram(#[from] crate::credentials_program::Error),
    /// What a manifest would say of the mark.
    #[error(transparent)]
    SoftBinding(#[from] guardsplat_soft_binding::Error),
    /// Man pages can't be written.
    #[error("{source}")]
    Packaging { source: std::io::Error },
}

impl Error {
    /// An option has a value outside its limits; the reason says the limit.
    pub fn bad_option(field: &'static str, reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self::Engine(Engine::BadOption { field, reason })
    }

    /// Reading or writing failed at `path`, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Engine(Engine::Io { path, source })
    }
}

impl From<guardsplat_codeword::Error> for Error {
    fn from(error: guardsplat_codeword::Error) -> Self {
        Self::Engine(error.into())
    }
}

impl From<guardsplat_scene::Error> for Error {
    fn from(error: guardsplat_scene::Error) -> Self {
        Self::Engine(error.into())
    }
}
