//! Workers: what they can hold, what jobs ask of them, and which ones were seen.
use super::Result;

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
    /// Bytes of memory that a job may take there; none where it did not say.
    pub memory: Option<i64>,
    /// CLIPs that it can load; any, when there are none.
    pub clips: Vec<String>,
}

/// The workers that ask for jobs.
#[async_trait::async_trait]
pub trait WorkerPresence: Send + Sync + 'static {
    /// Notes that a worker was seen, and forgets those that were not for a day.
    async fn note_worker(&self, worker: SeenWorker, now: i64) -> Result<()>;

    /// Workers that were seen since then, or that have a job, by name.
    async fn workers_since(&self, since: i64) -> Result<Vec<SeenWorker>>;
}

/// Microseconds after which a worker that was not seen is forgotten.
pub(super) const FORGOTTEN: i64 = 24 * 60 * 60 * 1_000_000;
