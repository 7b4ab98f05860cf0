//! What can go wrong with secrets. No variant holds any part of one.
use std::path::PathBuf;

use crate::error::Error;

/// A result of this module.
pub type SecretResult<T> = Result<T, SecretError>;

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum SecretError {
    /// A text that is not a master key.
    #[error("{place}: not a master key, which has {digits} hexadecimal digits")]
    NotAKey {
        /// Where it is from.
        place: String,
        /// Digits that it must have.
        digits: usize,
    },
    /// The operating system gives no random numbers.
    #[error("no random numbers: {0}")]
    NoRandomness(String),
    /// A file can't be read or written.
    #[error("master key: {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Secrets are kept already, and the master key that they need is not there.
    #[error(
        "{} is missing, and keys are kept that only it opens; put it back, or name the master key by the environment \
         variable {} or the setting master_key_file", path.display(), super::MASTER_KEY_VARIABLE
    )]
    Missing {
        /// The file that is not there.
        path: PathBuf,
    },
    /// The master key is not the one that the data folder was begun with.
    #[error("{place}: this master key has the id {given}, and the keys that are kept need the one with {needed}")]
    OtherKey {
        /// Where the master key is from.
        place: String,
        /// Its id.
        given: String,
        /// The id of the one that is needed.
        needed: String,
    },
    /// Not a sealed text.
    #[error("not a sealed text, or cut off")]
    NotSealed,
    /// A sealed text of a version that this server does not know.
    #[error("sealed in format {found}, and this server knows format {known}")]
    UnknownVersion {
        /// Its format.
        found: u8,
        /// The format that is known.
        known: u8,
    },
    /// Sealed under another master key.
    #[error("sealed under the master key with the id {needed}, and the one in use has {given}")]
    WrongKey {
        /// Id of the key that is needed.
        needed: String,
        /// Id of the key in use.
        given: String,
    },
    /// The text, or what it belongs to, was changed after it was sealed.
    #[error("a sealed text was altered, or belongs somewhere else")]
    Altered,
    /// The text could not be sealed.
    #[error("sealing failed")]
    SealFailed,
}

impl From<SecretError> for Error {
    fn from(error: SecretError) -> Self {
        Self::internal("a secret", error)
    }
}
