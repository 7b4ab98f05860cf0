//! What can go wrong with artifacts' bytes.
use std::io::ErrorKind;
use std::path::PathBuf;
use std::time::Duration;

use super::Place;
use super::local::FOLDER;
use crate::error::Error;
use crate::secrets::SecretError;

/// A result of the store.
pub type StoreResult<T> = Result<T, StoreError>;

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Longer than the server takes.
    #[error("{size} bytes are announced, and at most {limit} are taken")]
    TooLarge {
        /// Bytes announced.
        size: u64,
        /// Most bytes.
        limit: u64,
    },
    /// One chunk is too long.
    #[error("a chunk has {size} bytes, and at most {limit} are taken")]
    ChunkTooLarge {
        /// Its bytes.
        size: usize,
        /// Most bytes.
        limit: usize,
    },
    /// More bytes arrived than were announced.
    #[error("{announced} bytes were announced, and more arrived")]
    TooLong {
        /// Bytes announced.
        announced: u64,
    },
    /// The bytes ended early.
    #[error("{announced} bytes were announced, and {received} arrived")]
    TooShort {
        /// Bytes announced.
        announced: u64,
        /// Bytes that arrived.
        received: u64,
    },
    /// Something of another length lies where the bytes should.
    #[error("{announced} bytes were announced, and {found} are there")]
    OtherLength {
        /// Bytes announced.
        announced: u64,
        /// Bytes there.
        found: u64,
    },
    /// Other bytes arrived than were announced.
    #[error("the bytes have SHA-256 {received}, and {announced} was announced")]
    WrongChecksum {
        /// SHA-256 announced, hexadecimal.
        announced: String,
        /// SHA-256 of what arrived, hexadecimal.
        received: String,
    },
    /// Reading was to begin behind the end.
    #[error("{offset} is behind the end, {size}")]
    BadOffset {
        /// Where to begin.
        offset: u64,
        /// Length in bytes.
        size: u64,
    },
    /// A path that the store never made.
    #[error("{0} is not the path of an artifact")]
    BadPath(String),
    /// The bytes are gone, though the ledger knows of them.
    #[error("the bytes at {path} are gone")]
    Gone {
        /// Their path in the store.
        path: String,
    },
    /// The disk is full.
    #[error("no space is left on the disk")]
    NoSpace(#[source] object_store::Error),
    /// The store failed.
    #[error("the artifact store failed")]
    Failed(#[source] object_store::Error),
    /// The store can't be reached, or is not well.
    #[error("the artifact store is not available")]
    Away(#[source] object_store::Error),
    /// The store says nothing.
    #[error("the artifact store did not answer within {} s", .0.as_secs())]
    Silent(Duration),
    /// The store gave less than was asked for.
    #[error("{wanted} bytes of {path} were asked for, and {read} came")]
    Short {
        /// Where the bytes are.
        path: String,
        /// Bytes asked for.
        wanted: u64,
        /// Bytes that came.
        read: u64,
    },
    /// A server can't begin with this store.
    #[error("artifacts: {place} can't be {what}")]
    Unusable {
        /// Where it is.
        place: Place,
        /// What was tried.
        what: &'static str,
        /// Why it can't be.
        source: Box<StoreError>,
    },
    /// The store has no bucket of that name.
    #[error("the bucket or container does not exist")]
    NoContainer,
    /// The store has the artifacts of another ledger.
    #[error(
        "artifacts: those in {place} are another ledger's, which the object `ledger` there says; name another bucket, prefix or \
         folder"
    )]
    OfAnother {
        /// Where it is.
        place: Place,
    },
    /// The folder can't be used.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder, or a file in it.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A sealed artifact can't be opened.
    #[error(transparent)]
    Sealed(#[from] SecretError),
}

impl StoreError {
    pub(super) fn unusable(place: &Place, what: &'static str, source: impl Into<Self>) -> Self {
        Self::Unusable {
            place: place.clone(),
            what,
            source: Box::new(source.into()),
        }
    }

    /// Whether it may be otherwise a little later.
    pub(super) fn passes(&self) -> bool {
        match self {
            Self::Away(_) | Self::Silent(_) | Self::Short { .. } => true,
            Self::Unusable { source, .. } => source.passes(),
            _ => false,
        }
    }
}

impl From<object_store::Error> for StoreError {
    fn from(error: object_store::Error) -> Self {
        match error {
            object_store::Error::NotFound { path, .. } => Self::Gone { path },
            error if is_full(&error) => Self::NoSpace(error),
            object_store::Error::Generic { store, .. } if store != FOLDER => Self::Away(error),
            error => Self::Failed(error),
        }
    }
}

/// Whether the cause is a full disk or a used-up quota.
fn is_full(error: &object_store::Error) -> bool {
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(error) = cause {
        if let Some(io) = error.downcast_ref::<std::io::Error>() {
            return matches!(io.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded);
        }
        cause = error.source();
    }
    false
}

impl From<StoreError> for Error {
    fn from(error: StoreError) -> Self {
        use StoreError as E;
        let field = match &error {
            E::TooLarge { .. } => "metadata.size_bytes",
            E::WrongChecksum { .. } => "metadata.sha256",
            E::ChunkTooLarge { .. } | E::TooLong { .. } | E::TooShort { .. } => "chunk",
            E::OtherLength { .. } => "upload",
            E::BadOffset { .. } => "offset",
            E::NoSpace(_) => return Self::NoSpace,
            E::Away(_) | E::Silent(_) | E::Short { .. } => {
                return Self::Unavailable {
                    what: "the artifact store",
                    source: error.into(),
                };
            }
            E::Sealed(_) => return Self::internal("opening a sealed key", error),
            E::BadPath(_)
            | E::Gone { .. }
            | E::Failed(_)
            | E::Folder { .. }
            | E::Unusable { .. }
            | E::NoContainer
            | E::OfAnother { .. } => {
                return Self::internal("the artifact store", error);
            }
        };
        Self::invalid(field, error.to_string())
    }
}
