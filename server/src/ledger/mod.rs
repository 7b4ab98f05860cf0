//! The job ledger: jobs, leases, artifacts and keys as rows of a database. The ledger is the whole queue. Beside it
//! the registry: owners, assets, and the chain of commitments, which only grows.
//!
//! A job is given to a worker by [`QueueLedger::claim_for`], which counts the attempt and hands out a fresh lease token;
//! [`queue`] says in which order. From then on every write for that attempt carries the token and is checked against the
//! job's in the transaction that writes; a worker that was given up can never overwrite its successor. What an attempt
//! makes stays invisible until [`Ledger::complete`] publishes it together with the result.
//!
//! Times are microseconds since 1970, UTC, and are passed in, so that tests can move the clock.
pub mod access;
mod again;
pub mod candidates;
mod chain;
#[cfg(test)]
pub mod conformance;
mod elsewhere;
mod error;
pub mod hooks;
mod numbers;
mod operations;
pub mod postgres;
pub mod queue;
mod registry;
pub mod retention;
pub mod retry;
pub mod sqlite;
mod token;
mod transition;
mod types;

use std::sync::Arc;
use std::time::Duration;

use guardsplat_commitment::{Signed, SigningKey};
use tokio::sync::broadcast;
use uuid::Uuid;

pub use access::{AccessLedger, NewToken, TokenId, TokenRow, Usage};
pub use elsewhere::Elsewhere;
pub use error::{LedgerError, Result};
pub use hooks::{
    DeliveryFilter, DeliveryId, DeliveryRow, DeliveryState, HookId, HookLedger, HookRow, NewHook, Sending, Topics,
};
pub use operations::{AttemptRow, OperationsLedger, Outcome, Running, Tally, Waiting};
pub use postgres::PostgresLedger;
pub use queue::{Needs, QueueLedger, SeenWorker, Taker};
pub use registry::{
    AssetFilter, AssetId, AssetRow, Candidate, CommitmentId, KeyState, NewAsset, NewOwner, OwnerId, OwnerRow,
    SealedSigningKey,
};
pub use retention::{Before, Expired, RetentionLedger};
pub use sqlite::SqliteLedger;
pub use types::{
    ArtifactId, ArtifactRow, ArtifactState, Completion, Failure, JobId, JobKind, JobRow, JobState, KeyId, KeyRow,
    Lease, NewArtifact, NewJob, NewKey, Origin, REASON_ATTEMPTS_EXHAUSTED, REASON_WORKER_LOST,
};

/// What the service keeps of its work. A call that returned `Ok` is on disk.
///
/// A caller may be dropped while it waits: then its change happens entirely or not at all.
#[tonic::async_trait]
pub trait Ledger: AccessLedger + HookLedger + OperationsLedger + QueueLedger + RetentionLedger {
    /// Queues a job. The same request id with the same request gives the job that the first call made. Requests are the
    /// same if kind, spec and display name are, whatever has become of the artifacts in them, or if fingerprints are:
    /// then their artifacts may have other names, but hold the same.
    ///
    /// # Errors
    /// `RequestIdReused` for the same request id with another request, or of another project; `NotFound` for an input or
    /// a key that isn't there (or isn't visible, or is another project's).
    async fn create_job(&self, new: NewJob, now: i64) -> Result<JobRow>;

    /// The job that was made under a request id, whatever has become of it.
    async fn find_request(&self, request: Uuid) -> Result<Option<JobRow>>;

    /// One job as it stands, with its position in the queue.
    async fn get_job(&self, id: JobId) -> Result<Option<JobRow>>;

    /// Jobs of a project in one of `states` (in any, when empty), newest first; those after `before` (the `create_time`
    /// and id of the last job of the page before).
    async fn list_jobs(
        &self,
        project: &str,
        states: &[JobState],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>>;

    /// Ends a queued job; asks for the end of a running one.
    ///
    /// # Errors
    /// `NotFound`; `Finished` when there is nothing left to end.
    async fn cancel_job(&self, id: JobId, now: i64) -> Result<JobRow>;

    /// Gives the next job to a worker that takes any, as [`QueueLedger::claim_for`] does.
    async fn claim(&self, worker: &str, lease: Duration, now: i64) -> Result<Option<Lease>> {
        self.claim_for(&Taker::of_anything(worker), lease, now).await
    }

    /// The job, if `token` is its current lease.
    ///
    /// # Errors
    /// `NotFound`, `LeaseLost`.
    async fn leased_job(&self, id: JobId, token: &str) -> Result<JobRow>;

    /// Extends the lease to `now + lease`, stores progress, and says whether the job is to end. The revision moves only
    /// when the progress did.
    ///
    /// # Errors
    /// `NotFound`, `LeaseLost`.
    async fn report(
        &self,
        id: JobId,
        token: &str,
        progress: Option<Vec<u8>>,
        lease: Duration,
        now: i64,
    ) -> Result<bool>;

    /// Ends a job successfully: result, outputs and key become visible at once. The attempt that did so may say the same
    /// again, in case the answer was lost: it gets the job as it is, and nothing changes.
    ///
    /// # Errors
    /// `NotFound`, `LeaseLost`; `NotAnOutput` for an artifact that this attempt didn't finish writing, or that is
    /// secret where it must not be, or the other way round.
    async fn complete(&self, id: JobId, token: &str, completion: Completion, now: i64) -> Result<JobRow>;

    /// Ends an attempt that failed. A retryable failure queues the job again after a pause while attempts are left
    /// (or ends it as cancelled, if that was asked for); any other fails the job. With `cancelled` the job ends as
    /// cancelled, and `failure` is not looked at.
    ///
    /// # Errors
    /// `NotFound`, `LeaseLost`; `CancelNotRequested` for `cancelled` when nobody asked.
    async fn fail(
        &self,
        id: JobId,
        token: &str,
        failure: Option<Failure>,
        retryable: bool,
        cancelled: bool,
        now: i64,
    ) -> Result<JobRow>;

    /// Takes a job back without charging the attempt; it gets its old place in the queue, or ends if that was asked
    /// for.
    ///
    /// # Errors
    /// `NotFound`, `LeaseLost`.
    async fn release(&self, id: JobId, token: &str, now: i64) -> Result<JobRow>;

    /// Has no lease end before `now + lease`: for a server that begins, or can write again, as no worker could report
    /// while none could write. Where several servers share the ledger and another of them has looked after leases
    /// meanwhile, nothing is extended: workers could report to that one, and a server that begins again and again must
    /// not keep alive what is dead.
    async fn renew_leases(&self, lease: Duration, now: i64) -> Result<()>;

    /// Ends the attempts whose lease has expired, and returns their jobs.
    async fn reap(&self, now: i64) -> Result<Vec<JobId>>;

    /// Announces an artifact whose bytes are about to be stored at `path`.
    ///
    /// # Errors
    /// For an output `NotFound` and `LeaseLost`.
    async fn create_artifact(&self, new: NewArtifact, now: i64) -> Result<ArtifactRow>;

    /// All bytes are stored. An upload becomes visible; an output (which needs the token that announced it) becomes
    /// one that `complete` may publish.
    ///
    /// # Errors
    /// `NotFound` when it isn't there or has been collected as abandoned; `LeaseLost`.
    async fn artifact_ready(&self, id: ArtifactId, token: Option<&str>, now: i64) -> Result<ArtifactRow>;

    /// A visible artifact; never a secret one.
    async fn get_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>>;

    /// Any artifact, for the server itself.
    async fn get_any_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>>;

    /// Hides an artifact for good. Its bytes may go now; until `forget_artifact` it is among the abandoned ones.
    ///
    /// # Errors
    /// `NotFound`, also for secret artifacts; `InUse` while a queued or running job needs it.
    async fn delete_artifact(&self, id: ArtifactId, now: i64) -> Result<()>;

    /// Marks as deleted, and returns with those already deleted, artifacts that nobody can want any more: uploads that
    /// never became ready, and outputs of attempts that are over, created before `older_than`. Delete the bytes, then
    /// forget the row.
    async fn abandoned_artifacts(&self, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>>;

    /// Removes the row of a deleted artifact whose bytes are gone.
    async fn forget_artifact(&self, id: ArtifactId) -> Result<()>;

    /// One key.
    async fn get_key(&self, id: KeyId) -> Result<Option<KeyRow>>;

    /// Keys of a project, newest first; those after `before`, as with `list_jobs`.
    async fn list_keys(&self, project: &str, before: Option<(i64, KeyId)>, limit: u32) -> Result<Vec<KeyRow>>;

    /// Retires or revokes a key, for a reason. One that is in that state stays as it is.
    ///
    /// # Errors
    /// `NotFound`; `KeyStateFinal` when nothing leads from the state it has to this one.
    async fn update_key_state(&self, id: KeyId, next: KeyState, reason: &str, now: i64) -> Result<KeyRow>;

    /// The key that commitments are signed with; none before the first start.
    async fn signing_key(&self) -> Result<Option<SealedSigningKey>>;

    /// Keeps a signing key for good, unless there is one already; returns the one that is kept.
    async fn keep_signing_key(&self, new: SealedSigningKey, now: i64) -> Result<SealedSigningKey>;

    /// Registers an owner. The same request id with the same display name gives the one that the first call made.
    ///
    /// # Errors
    /// `RequestIdReused` for the same request id with another name, or of another project.
    async fn create_owner(&self, new: NewOwner, now: i64) -> Result<OwnerRow>;

    /// One owner.
    async fn get_owner(&self, id: OwnerId) -> Result<Option<OwnerRow>>;

    /// Owners of a project, newest first; those after `before`, as with `list_jobs`.
    async fn list_owners(&self, project: &str, before: Option<(i64, OwnerId)>, limit: u32) -> Result<Vec<OwnerRow>>;

    /// Registers an asset: gives it the next payload number of its key, and appends a commitment to the chain, signed by
    /// `signer`, at once. The same request id with the same owner, key, hash and display name gives the asset that the
    /// first call made, with the nonce of then.
    ///
    /// # Errors
    /// `RequestIdReused` for the same request id with another asset, or of another project; `NotFound` for an owner or a
    /// key that isn't there or is another project's; `KeyNotActive`, `PayloadsUsedUp`.
    async fn create_asset(&self, new: NewAsset, signer: Arc<SigningKey>, now: i64) -> Result<AssetRow>;

    /// The asset that was registered under a request id.
    async fn find_asset_request(&self, request: Uuid) -> Result<Option<AssetRow>>;

    /// One asset.
    async fn get_asset(&self, id: AssetId) -> Result<Option<AssetRow>>;

    /// Assets of a project, newest first; those after `before`, as with `list_jobs`.
    async fn list_assets(
        &self,
        project: &str,
        filter: AssetFilter,
        before: Option<(i64, AssetId)>,
        limit: u32,
    ) -> Result<Vec<AssetRow>>;

    /// Assets of a key by payload number, those with higher ones than `after`. [`candidates::of_key`] reads all.
    async fn candidates(&self, key: KeyId, after: i64, limit: u32) -> Result<Vec<Candidate>>;

    /// One asset as a search has it.
    async fn candidate(&self, asset: AssetId) -> Result<Option<Candidate>>;

    /// One commitment.
    async fn get_commitment(&self, id: CommitmentId) -> Result<Option<Signed>>;

    /// Commitments to assets of a project in the order of the chain, those behind the one at place `after`. The chain is
    /// one for all projects, so there may be others in between.
    async fn list_commitments(&self, project: &str, after: i64, limit: u32) -> Result<Vec<Signed>>;

    /// The last commitment of the chain that is to an asset of a project.
    async fn head(&self, project: &str) -> Result<Option<Signed>>;

    /// How many jobs are queued.
    async fn queue_depth(&self) -> Result<i64>;

    /// Whether the ledger can be read and written.
    async fn check(&self) -> Result<()>;

    /// Whether other servers may use the ledger at the same time.
    fn is_shared(&self) -> bool;

    /// What other servers change from now on; `None` where there can't be any.
    fn elsewhere(&self) -> Option<broadcast::Receiver<Elsewhere>>;

    /// Finishes what was begun and closes the database. Later calls fail with `Closed`.
    async fn close(&self);
}
