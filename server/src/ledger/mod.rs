//! The job ledger: jobs, leases, artifacts and keys as rows of a database. The ledger is the whole queue. Beside it
//! the registry: owners, assets, and the chain of commitments, which only grows.
//!
//! A job is given to a worker by [`JobQueue::claim_for`], which counts the attempt and hands out a fresh lease token;
//! [`queue`] says in which order. From then on every write for that attempt carries the token and is checked against the
//! job's in the transaction that writes; a worker that was given up can never overwrite its successor. What an attempt
//! makes stays invisible until [`JobQueue::complete`] publishes it together with the result.
//!
//! Times are microseconds since 1970, UTC, and are passed in, so that tests can move the clock.
//!
//! [`Ledger`] is all that a ledger can do; its parts are traits of their own, each in the file of what it is about.
#[macro_use]
mod shared;

mod artifacts;
pub mod candidates;
mod chain;
mod codec;
mod commitments;
#[cfg(test)]
pub mod conformance;
mod credentials;
mod discriminants;
mod error;
mod generation;
mod history;
pub mod hooks;
mod idempotency;
mod jobs;
mod keys;
pub mod postgres;
pub mod queue;
mod registry;
mod remote_changes;
mod reservations;
pub mod retention;
pub mod retry;
pub mod sqlite;
mod statistics;
mod token;
mod tokens;
mod transition;
mod types;
mod work;
mod workers;

use tokio::sync::broadcast;

pub use artifacts::ArtifactLedger;
pub use commitments::{CommitmentLog, SealedSigningKey};
pub use credentials::{CredentialsLedger, CredentialsOf, CredentialsRow, Mark, NewCredentials};
pub use error::{LedgerError, Result};
pub use generation::{Generation, GenerationLedger};
pub use history::{Before as ReadBefore, NewReading, ReadingHistory};
pub use hooks::{
    Busy, DeliveryFilter, DeliveryId, DeliveryRow, DeliveryState, HookId, HookLedger, HookRow, MOST_WAITING, NewHook,
    Sending, Topics,
};
pub use jobs::{AttemptRow, JobStore, Outcome};
pub use keys::KeyLedger;
pub use postgres::PostgresLedger;
pub use queue::JobQueue;
pub use registry::{
    AssetFilter, AssetId, AssetRow, Candidate, CommitmentId, KeyState, MARK_CODE, NewAsset, NewOwner, OwnerId,
    OwnerRow, Registry,
};
pub use remote_changes::RemoteChange;
pub use reservations::{UploadReservation, UploadReservations};
pub use retention::{Before, Expired, Retention};
pub use sqlite::SqliteLedger;
pub use statistics::{Running, Statistics, Tally, Usage, Waiting};
pub use tokens::{NewToken, TokenId, TokenLedger, TokenRow};
pub use types::{
    ArtifactId, ArtifactRow, ArtifactState, Completion, Failure, FailureReason, JobId, JobKind, JobRow, JobState,
    KeyId, KeyRow, Lease, NewArtifact, NewJob, NewKey, Origin,
};
pub use work::{JobResult, JobSpec, KeyOrder, Progress, Seed};
pub use workers::{LeasedJob, ResourceRequirements, SeenWorker, WorkerCapabilities, WorkerPresence, WorkerRow};

/// What the service keeps of its work, by capability. A call that returned `Ok` is on disk.
///
/// A caller may be dropped while it waits: then its change happens entirely or not at all.
#[async_trait::async_trait]
pub trait Ledger:
    ArtifactLedger
    + CommitmentLog
    + CredentialsLedger
    + GenerationLedger
    + HookLedger
    + JobQueue
    + JobStore
    + KeyLedger
    + ReadingHistory
    + Registry
    + Retention
    + Statistics
    + TokenLedger
    + UploadReservations
    + WorkerPresence
{
    /// Whether the ledger can be read and written.
    async fn check(&self) -> Result<()>;

    /// Whether other servers may use the ledger at the same time.
    fn is_shared(&self) -> bool;

    /// What other servers change from now on; `None` where there can't be any.
    fn remote_changes(&self) -> Option<broadcast::Receiver<RemoteChange>>;

    /// Finishes what was begun and closes the database. Later calls fail with `Closed`.
    async fn close(&self);
}
