//! Workers: what they can hold, what jobs ask of them, and which ones were seen.
use super::Result;
use super::types::JobId;

/// What a job asks of the worker that it is given to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ResourceRequirements {
    /// Bytes of memory that it takes at least; none where that is not known.
    pub memory: Option<i64>,
    /// Bytes that it will probably take.
    pub likely_memory: Option<i64>,
    /// SHA-256 of the CLIP of its key, lower-case hexadecimal.
    pub clip: Option<String>,
}

/// Who takes a job, and which ones may be given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WorkerCapabilities {
    /// The worker.
    pub worker: String,
    /// Most bytes of memory that a job may take at least; none for no limit.
    pub memory: Option<i64>,
    /// Most bytes that a job may probably take; none for no limit.
    pub likely_memory: Option<i64>,
    /// CLIPs that it can load; any, when there are none.
    pub clips: Vec<String>,
}

impl WorkerCapabilities {
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
    /// Its version; empty where it did not say.
    pub version: String,
    /// Bytes of memory that a job may take there; none where it did not say.
    pub memory: Option<i64>,
    /// CLIPs that it can load; any, when there are none.
    pub clips: Vec<String>,
}

/// A worker, and what it does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorkerRow {
    /// How it described itself.
    pub seen: SeenWorker,
    /// When it last asked for a job.
    pub time: i64,
    /// What it has, if anything.
    pub has: Option<LeasedJob>,
}

/// The job that a worker has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeasedJob {
    /// The job.
    pub id: JobId,
    /// Whose it is.
    pub project: String,
    /// How often it was given to a worker.
    pub attempt: i32,
    /// When this one was given it.
    pub start_time: i64,
    /// When its lease ends, unless the worker is heard of again.
    pub lease_expires: i64,
}

/// The workers that ask for jobs.
#[async_trait::async_trait]
pub trait WorkerPresence: Send + Sync + 'static {
    /// Notes that a worker was seen, and forgets those that were not for a day and have no job.
    async fn note_worker(&self, worker: SeenWorker, now: i64) -> Result<()>;

    /// Workers that were seen since then, or that have a job, by name.
    async fn workers_since(&self, since: i64) -> Result<Vec<SeenWorker>>;

    /// The same with what they have, by name, at most so many: one that has several jobs, as workers of one name may, is
    /// there once for each.
    async fn workers_and_jobs(&self, since: i64, limit: u32) -> Result<Vec<WorkerRow>>;
}

/// Microseconds after which a worker that was not seen is forgotten.
pub(super) const FORGOTTEN: i64 = 24 * 60 * 60 * 1_000_000;
