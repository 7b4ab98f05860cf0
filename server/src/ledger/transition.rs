//! What becomes of a job that leaves the queue or its worker: decided here, written by each database in one place.
use std::time::Duration;

use super::types::{Failure, FailureReason, JobId, JobRow, JobState};
use super::work::JobResult;
use super::{LedgerError, Result, retry};

/// Where a job goes.
#[derive(Debug)]
pub(super) enum Next {
    /// Done, with its result.
    Succeeded(Box<JobResult>),
    /// Given up.
    Failed(Failure),
    /// Ended as asked.
    Cancelled,
    /// Back to the queue after a failed attempt, not to be given out before the time.
    Retry(Failure, i64),
    /// Back to its old place in the queue, the attempt not counted.
    Released,
}

/// What a job's row is to hold from then on.
pub(super) struct Left {
    pub(super) state: JobState,
    pub(super) result: Option<JobResult>,
    pub(super) failure: Option<Failure>,
    pub(super) run_after: Option<i64>,
    /// Attempts that do not count after all.
    pub(super) uncounted: i32,
    pub(super) end_time: Option<i64>,
}

impl Next {
    pub(super) fn row(self, now: i64) -> Left {
        let (state, result, failure, run_after, uncounted) = match self {
            Self::Succeeded(result) => (JobState::Succeeded, Some(*result), None, None, 0),
            Self::Failed(failure) => (JobState::Failed, None, Some(failure), None, 0),
            Self::Cancelled => (JobState::Cancelled, None, None, None, 0),
            Self::Retry(failure, run_after) => (JobState::Queued, None, Some(failure), Some(run_after), 0),
            Self::Released => (JobState::Queued, None, None, None, 1),
        };
        Left {
            state,
            result,
            failure,
            run_after,
            uncounted,
            end_time: state.is_over().then_some(now),
        }
    }
}

/// After an attempt of which its worker says that it failed.
///
/// # Errors
/// `CancelNotRequested` for `cancelled` when nobody asked.
pub(super) fn after_attempt(
    job: &JobRow,
    failure: Option<Failure>,
    retryable: bool,
    cancelled: bool,
    now: i64,
) -> Result<Next> {
    let failure = failure.unwrap_or_else(|| Failure {
        reason: FailureReason::Unspecified,
        message: "the worker gave no reason".into(),
    });
    match (cancelled, retryable) {
        (true, _) if job.cancel_requested => Ok(Next::Cancelled),
        (true, _) => Err(LedgerError::CancelNotRequested(job.id)),
        (false, true) => Ok(after_failure(job, failure, now)),
        (false, false) => Ok(Next::Failed(failure)),
    }
}

/// After an attempt whose worker did not report in time.
pub(super) fn after_loss(job: &JobRow, worker: Option<String>, now: i64) -> Next {
    let message = format!(
        "worker {:?} was lost: it did not report in time",
        worker.unwrap_or_default()
    );
    let failure = Failure {
        reason: FailureReason::WorkerLost,
        message,
    };
    after_failure(job, failure, now)
}

/// After an attempt that is not charged.
pub(super) fn after_release(job: &JobRow) -> Next {
    if job.cancel_requested {
        Next::Cancelled
    } else {
        Next::Released
    }
}

/// After a failed attempt that might be repeated: cancelled if that was asked for, another attempt if one is left,
/// otherwise given up.
fn after_failure(job: &JobRow, failure: Failure, now: i64) -> Next {
    if job.cancel_requested {
        Next::Cancelled
    } else if job.attempt < job.max_attempts {
        Next::Retry(failure, now.saturating_add(retry::backoff(job.attempt)))
    } else {
        let message = format!("all {} attempts failed; the last one: {}", job.attempt, failure.message);
        Next::Failed(Failure {
            reason: FailureReason::AttemptsExhausted,
            message,
        })
    }
}

/// What cancelling does to a job.
pub(super) enum Cancel {
    /// It ends.
    End,
    /// Its worker is asked to end it.
    Ask,
    /// Its worker was asked before.
    Asked,
}

/// What cancelling a job does, as it stands.
///
/// # Errors
/// `Finished` when there is nothing left to end.
pub(super) fn cancel(id: JobId, job: &JobRow) -> Result<Cancel> {
    match job.state {
        JobState::Queued => Ok(Cancel::End),
        JobState::Running if job.cancel_requested => Ok(Cancel::Asked),
        JobState::Running => Ok(Cancel::Ask),
        state => Err(LedgerError::Finished { job: id, state }),
    }
}

/// When a lease ends that is given or extended now.
pub(super) fn end_of(lease: Duration, now: i64) -> i64 {
    now.saturating_add(micros(lease))
}

/// A length of time in microseconds.
pub(super) fn micros(time: Duration) -> i64 {
    i64::try_from(time.as_micros()).unwrap_or(i64::MAX)
}
