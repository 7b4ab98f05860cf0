//! The queue: the order in which jobs are given to workers, and the leases that they are given under.
//!
//! Jobs of one project and one priority are a *lane*, and leave it in the order of their `queue_time`. Of all lanes the
//! one of the highest priority is served first; of several the one whose project has the fewest running jobs; of those
//! the one whose first job is the oldest. A lane that waits for longer than [`PATIENCE`] while nothing of it is begun
//! gets one turn before all others. Jobs that the worker can't hold are passed over.
use std::time::Duration;

use super::Result;
use super::types::{Completion, Failure, JobId, JobRow, Lease};
use super::work::Progress;
use super::workers::WorkerCapabilities;

/// What may be asked for.
pub const PRIORITIES: std::ops::RangeInclusive<i32> = -10..=10;

/// After so long without a turn a lane gets one, whatever its priority.
pub const PATIENCE: Duration = Duration::from_secs(10 * 60);

/// The queue, and jobs as workers see them: leased, reported on, ended.
#[async_trait::async_trait]
pub trait JobQueue: Send + Sync + 'static {
    /// Gives the next job that it can hold to a worker, counting the attempt. A job whose attempts are used up is never
    /// given out; it fails here.
    async fn claim_for(&self, capabilities: &WorkerCapabilities, lease: Duration, now: i64) -> Result<Option<Lease>>;

    /// Gives the next job to a worker that takes any, as [`JobQueue::claim_for`] does.
    async fn claim(&self, worker: &str, lease: Duration, now: i64) -> Result<Option<Lease>> {
        self.claim_for(&WorkerCapabilities::of_anything(worker), lease, now)
            .await
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
        progress: Option<Progress>,
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

    /// The queue in its order, as things stand.
    async fn queue(&self) -> Result<Vec<JobId>>;

    /// How many jobs are queued.
    async fn queue_depth(&self) -> Result<i64>;
}
