//! The order of the queue, and the workers that it is given to: a trait of its own beside [`super::Ledger`], which has
//! it as a supertrait.
//!
//! Jobs of one project and one priority are a *lane*, and leave it in the order of their `queue_time`. Of all lanes the
//! one of the highest priority is served first; of several the one whose project has the fewest running jobs; of those
//! the one whose first job is the oldest. A lane that waits for longer than [`PATIENCE`] while nothing of it is begun
//! gets one turn before all others. Jobs that the worker can't hold are passed over.
use std::time::Duration;

use super::Result;
use super::types::{JobId, JobRow, Lease};

/// What may be asked for.
pub const PRIORITIES: std::ops::RangeInclusive<i32> = -10..=10;

/// After so long without a turn a lane gets one, whatever its priority.
pub const PATIENCE: Duration = Duration::from_secs(10 * 60);

/// What a job asks of the worker that it is given to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Bytes of memory that it takes at least; none where that is not known.
    pub memory: Option<i64>,
    /// Bytes that it will probably take.
    pub likely_memory: Option<i64>,
    /// SHA-256 of the CLIP of its key, lower-case hexadecimal.
    pub clip: Option<String>,
}

/// Who takes a job, and which ones may be given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Taker {
    /// The worker.
    pub worker: String,
    /// Most bytes of memory that a job may take at least; none for no limit.
    pub memory: Option<i64>,
    /// Most bytes that a job may probably take; none for no limit.
    pub likely_memory: Option<i64>,
    /// CLIPs that it can load; any, when there are none.
    pub clips: Vec<String>,
}

impl Taker {
    /// A worker that takes whatever comes.
    pub fn of_anything(worker: &str) -> Self {
        Self {
            worker: worker.to_owned(),
            ..Self::default()
        }
    }

    /// CLIPs as a statement takes them: none for any.
    pub(super) fn clips(&self) -> Option<&[String]> {
        Some(&self.clips[..]).filter(|clips| !clips.is_empty())
    }
}

/// A worker as it described itself when it asked for a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeenWorker {
    /// What it calls itself.
    pub name: String,
    /// What it computes on.
    pub device: String,
    /// Bytes of memory that a job may take there; none where it did not say.
    pub memory: Option<i64>,
    /// CLIPs that it can load; any, when there are none.
    pub clips: Vec<String>,
}

/// What the service keeps of the queue's order, and of who takes jobs.
#[tonic::async_trait]
pub trait QueueLedger: Send + Sync + 'static {
    /// Gives the next job that it can hold to a worker, counting the attempt. A job whose attempts are used up is never
    /// given out; it fails here.
    async fn claim_for(&self, taker: &Taker, lease: Duration, now: i64) -> Result<Option<Lease>>;

    /// Notes that a worker was seen, and forgets those that were not for a day.
    async fn note_worker(&self, worker: SeenWorker, now: i64) -> Result<()>;

    /// Workers that were seen since then, or that have a job, by name.
    async fn workers_since(&self, since: i64) -> Result<Vec<SeenWorker>>;

    /// One job as it stands, without its position in the queue.
    async fn peek_job(&self, id: JobId) -> Result<Option<JobRow>>;

    /// The queue in its order, as things stand.
    async fn queue(&self) -> Result<Vec<JobId>>;
}

/// Microseconds after which a worker that was not seen is forgotten.
pub(super) const FORGOTTEN: i64 = 24 * 60 * 60 * 1_000_000;
