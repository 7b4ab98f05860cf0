//! What operators want of the ledger: how much there is to do, what became of attempts, and another try for a job that
//! failed. A trait of its own beside [`super::Ledger`], which has it as a supertrait.
use super::types::{ArtifactId, Failure, JobId, JobKind, JobRow};
use super::{LedgerError, Result};

/// How many jobs there are to do, being done, and given up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Queued jobs by kind; a kind of which none is queued may be missing.
    pub queued: Vec<Waiting>,
    /// Running jobs by kind; a kind of which none runs may be missing.
    pub running: Vec<Running>,
    /// Failed jobs by kind and reason.
    pub failed: Vec<(JobKind, i32, u64)>,
}

/// The queued jobs of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waiting {
    /// What they do.
    pub kind: JobKind,
    /// How many they are.
    pub count: u64,
    /// Since when the first of them could have been given to a worker; it may lie ahead, after a failed attempt.
    pub since: i64,
}

/// The running jobs of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Running {
    /// What they do.
    pub kind: JobKind,
    /// How many they are.
    pub count: u64,
    /// Bytes of memory that they probably take together, as far as their scenes told.
    pub memory: u64,
}

/// How an attempt ended. Numbers are kept in the database, and are those of `guardsplat.v1.JobAttempt.Outcome`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// It has not.
    UnderWay = 0,
    /// The job succeeded.
    Succeeded = 1,
    /// It failed, or its worker was lost.
    Failed = 2,
    /// The job was cancelled.
    Cancelled = 3,
    /// The worker handed the job back.
    Released = 4,
}

impl Outcome {
    pub(super) fn from_number(value: i64) -> Result<Self> {
        let all = [
            Self::UnderWay,
            Self::Succeeded,
            Self::Failed,
            Self::Cancelled,
            Self::Released,
        ];
        let known = all.into_iter().find(|&outcome| outcome as i64 == value);
        known.ok_or(LedgerError::Corrupt {
            what: "outcome of an attempt",
            value,
        })
    }
}

/// One time that a worker was given a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttemptRow {
    /// Counts what workers were given of the job, from 1.
    pub number: i32,
    /// What the worker called itself.
    pub worker: String,
    /// When it was given the job.
    pub start_time: i64,
    /// When the attempt ended.
    pub end_time: Option<i64>,
    /// How.
    pub outcome: Outcome,
    /// Why it failed.
    pub failure: Option<Failure>,
}

/// What the service keeps for those who look after it.
#[tonic::async_trait]
pub trait OperationsLedger: Send + Sync + 'static {
    /// How many jobs there are, of all projects.
    async fn tally(&self) -> Result<Tally>;

    /// Jobs of a project that failed for one of these reasons, newest first; those after `before`, as with `list_jobs`.
    async fn list_failed(
        &self,
        project: &str,
        reasons: &[i32],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>>;

    /// The newest attempts of a job, newest first, 20 at most; none for a job that is not there.
    async fn attempts(&self, job: JobId) -> Result<Vec<AttemptRow>>;

    /// Queues a job that failed once more, at the end of the queue, its attempts counted anew. `inputs` are the artifacts
    /// that it reads.
    ///
    /// # Errors
    /// `NotFound` for the job, or an input that is gone; `NotFailed`.
    async fn requeue(&self, job: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow>;
}

/// A number of rows.
pub(super) fn count(value: i64) -> u64 {
    u64::try_from(value).unwrap_or_default()
}

/// Reasons as bits, for a database that takes no lists.
pub(super) fn bits(reasons: &[i32]) -> i64 {
    let bit = |&reason: &i32| u32::try_from(reason).ok().and_then(|reason| 1_i64.checked_shl(reason));
    reasons.iter().filter_map(bit).fold(0, |all, bit| all | bit)
}
