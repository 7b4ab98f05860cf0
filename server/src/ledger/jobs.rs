//! Jobs as their owners see them: queued, looked at, listed, cancelled, tried again.
use uuid::Uuid;

use super::types::{ArtifactId, Failure, FailureReason, JobId, JobRow, JobState, NewJob};
use super::{LedgerError, Result};

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

/// The jobs of all projects.
#[async_trait::async_trait]
pub trait JobStore: Send + Sync + 'static {
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

    /// One job as it stands, without its position in the queue.
    async fn peek_job(&self, id: JobId) -> Result<Option<JobRow>>;

    /// Jobs of a project in one of `states` (in any, when empty), newest first; those after `before` (the `create_time`
    /// and id of the last job of the page before). Without their positions in the queue.
    async fn list_jobs(
        &self,
        project: &str,
        states: &[JobState],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>>;

    /// Jobs of a project that failed for one of these reasons, newest first; those after `before`, as with `list_jobs`.
    async fn list_failed(
        &self,
        project: &str,
        reasons: &[FailureReason],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>>;

    /// The newest attempts of a job, newest first, 20 at most; none for a job that is not there.
    async fn attempts(&self, job: JobId) -> Result<Vec<AttemptRow>>;

    /// Ends a queued job; asks for the end of a running one.
    ///
    /// # Errors
    /// `NotFound`; `Finished` when there is nothing left to end.
    async fn cancel_job(&self, id: JobId, now: i64) -> Result<JobRow>;

    /// Queues a job that failed once more, at the end of the queue, its attempts counted anew. `inputs` are the artifacts
    /// that it reads.
    ///
    /// # Errors
    /// `NotFound` for the job, or an input that is gone; `NotFailed`.
    async fn requeue(&self, job: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow>;
}

/// Reasons as bits, as not every database takes lists.
pub(super) fn bits(reasons: &[FailureReason]) -> i64 {
    reasons.iter().fold(0, |all, &reason| all | 1 << reason as i32)
}
