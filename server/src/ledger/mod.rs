//! The job ledger: jobs, leases, artifacts and keys as rows of a database. The ledger is the whole queue.
//!
//! A job is given to a worker by [`Ledger::claim`], which counts the attempt and hands out a fresh lease token. From
//! then on every write for that attempt carries the token and is checked against the job's in the transaction that
//! writes; a worker that was given up can never overwrite its successor. What an attempt makes stays invisible until
//! [`Ledger::complete`] publishes it together with the result.
//!
//! Times are microseconds since 1970, UTC, and are passed in, so that tests can move the clock.
#[cfg(test)]
pub mod conformance;
mod error;
pub mod retry;
pub mod sqlite;
mod token;
mod types;

use std::time::Duration;

use uuid::Uuid;

pub use error::{LedgerError, Result};
pub use sqlite::SqliteLedger;
pub use types::{
    ArtifactId, ArtifactRow, ArtifactState, Completion, Failure, JobId, JobKind, JobRow, JobState, KeyId, KeyRow,
    Lease, NewArtifact, NewJob, NewKey, Origin, REASON_ATTEMPTS_EXHAUSTED, REASON_WORKER_LOST,
};

/// What the service keeps of its work. A call that returned `Ok` is on disk.
///
/// A caller may be dropped while it waits: then its change happens entirely or not at all.
#[tonic::async_trait]
pub trait Ledger: Send + Sync + 'static {
    /// Queues a job. The same request id with the same request gives the job that the first call made. Requests are the
    /// same if kind, spec and display name are, whatever has become of the artifacts in them, or if fingerprints are:
    /// then their artifacts may have other names, but hold the same.
    ///
    /// # Errors
    /// `RequestIdReused` for the same request id with another request, `NotFound` for an input or a key that isn't
    /// there (or isn't visible).
    async fn create_job(&self, new: NewJob, now: i64) -> Result<JobRow>;

    /// The job that was made under a request id, whatever has become of it.
    async fn find_request(&self, request: Uuid) -> Result<Option<JobRow>>;

    /// One job as it stands, with its position in the queue.
    async fn get_job(&self, id: JobId) -> Result<Option<JobRow>>;

    /// Jobs in one of `states` (in any, when empty), newest first; those after `before` (the `create_time` and id of
    /// the last job of the page before).
    async fn list_jobs(&self, states: &[JobState], before: Option<(i64, JobId)>, limit: u32) -> Result<Vec<JobRow>>;

    /// Ends a queued job; asks for the end of a running one.
    ///
    /// # Errors
    /// `NotFound`; `Finished` when there is nothing left to end.
    async fn cancel_job(&self, id: JobId, now: i64) -> Result<JobRow>;

    /// Gives the next job to a worker, counting the attempt. A job whose attempts are used up is never given out; it
    /// fails here.
    async fn claim(&self, worker: &str, lease: Duration, now: i64) -> Result<Option<Lease>>;

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

    /// Has no lease end before `now + lease`: for a server that begins, as no worker could report while none was there.
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

    /// Keys, newest first; those after `before`, as with `list_jobs`.
    async fn list_keys(&self, before: Option<(i64, KeyId)>, limit: u32) -> Result<Vec<KeyRow>>;

    /// How many jobs are queued.
    async fn queue_depth(&self) -> Result<i64>;

    /// Whether the ledger can be read and written.
    async fn check(&self) -> Result<()>;
}
