//! What can go wrong in the ledger.
use std::sync::Arc;

use uuid::Uuid;

use super::registry::KeyState;
use super::types::{ArtifactId, JobId, JobState, KeyId};

/// Result of a ledger operation.
pub type Result<T> = std::result::Result<T, LedgerError>;

/// Why the ledger refused or could not do something.
#[derive(Clone, Debug, thiserror::Error)]
pub enum LedgerError {
    /// There is no such thing, or it isn't visible.
    #[error("there is no {kind} {id}")]
    NotFound {
        /// `job`, `artifact`, `key` or `owner`.
        kind: &'static str,
        /// Which.
        id: Uuid,
    },
    /// The request id was used for something else.
    #[error("request id {0} was used for another request")]
    RequestIdReused(Uuid),
    /// The job is over, so it can't be cancelled.
    #[error("job {job} is already over")]
    Finished {
        /// Which.
        job: JobId,
        /// How it ended.
        state: JobState,
    },
    /// Only a job that failed is queued once more.
    #[error("job {0} has not failed")]
    NotFailed(JobId),
    /// The token is not the job's current lease.
    #[error("the lease of job {0} is lost: another attempt has it, or it is over")]
    LeaseLost(JobId),
    /// A queued or running job needs the artifact.
    #[error("artifact {artifact} is needed by job {job}")]
    InUse {
        /// What was to be deleted.
        artifact: ArtifactId,
        /// A job that needs it.
        job: JobId,
    },
    /// The artifact can't be published by this attempt.
    #[error("artifact {0} is no finished output of this attempt")]
    NotAnOutput(ArtifactId),
    /// A worker gave a job up as cancelled that nobody had cancelled.
    #[error("nobody asked for the end of job {0}")]
    CancelNotRequested(JobId),
    /// The key takes no more assets.
    #[error("key {key} is {}", state.word())]
    KeyNotActive {
        /// Which.
        key: KeyId,
        /// What it is.
        state: KeyState,
    },
    /// The key can't go from the state it has to another one.
    #[error("key {key} is {}, and never becomes {} again", state.word(), wanted.word())]
    KeyStateFinal {
        /// Which.
        key: KeyId,
        /// What it is.
        state: KeyState,
        /// What it was to become.
        wanted: KeyState,
    },
    /// The key has given out all payload numbers that its messages can hold.
    #[error("all {limit} payload numbers of key {key} are used up")]
    PayloadsUsedUp {
        /// Which.
        key: KeyId,
        /// How many it had.
        limit: i64,
    },
    /// What is kept of a commitment can't be read.
    #[error("commitment {sequence} can't be read")]
    BadCommitment {
        /// Its place in the chain.
        sequence: i64,
        /// Why not.
        #[source]
        source: guardsplat_commitment::Error,
    },
    /// The database can't be reached now, or refused the change because of others at the same time. The same call may
    /// succeed a little later; one that changes something may have done so all the same.
    #[error("the ledger's database is not available")]
    Unavailable(#[source] Arc<sqlx::Error>),
    /// The database failed.
    #[error("the ledger's database failed")]
    Database(#[source] Arc<sqlx::Error>),
    /// The database could not be brought to this version's layout.
    #[error("the ledger's database could not be set up")]
    Migrate(#[source] Arc<sqlx::migrate::MigrateError>),
    /// A row holds something that this version doesn't know.
    #[error("the ledger holds an unknown {what}: {value}")]
    Corrupt {
        /// What kind of value.
        what: &'static str,
        /// The value.
        value: i64,
    },
    /// A row holds a message that is none.
    #[error("the {what} of a job that the ledger holds can't be read")]
    Undecodable {
        /// What kind of message.
        what: &'static str,
        /// Why not.
        #[source]
        source: prost::DecodeError,
    },
    /// The result is of another kind than the job.
    #[error("the result of job {0} is one of another kind of job")]
    ResultOfAnotherKind(JobId),
    /// The ledger has been closed.
    #[error("the ledger is closed")]
    Closed,
}

impl LedgerError {
    pub(crate) fn no_job(id: JobId) -> Self {
        Self::NotFound { kind: "job", id }
    }

    pub(crate) fn no_artifact(id: ArtifactId) -> Self {
        Self::NotFound { kind: "artifact", id }
    }
}

impl From<sqlx::Error> for LedgerError {
    fn from(error: sqlx::Error) -> Self {
        Self::Database(Arc::new(error))
    }
}

impl From<sqlx::migrate::MigrateError> for LedgerError {
    fn from(error: sqlx::migrate::MigrateError) -> Self {
        Self::Migrate(Arc::new(error))
    }
}
