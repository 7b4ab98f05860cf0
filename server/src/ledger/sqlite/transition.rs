//! What becomes of a job that leaves the queue or its worker: the one place where a job ends or is queued again.
use sqlx::SqliteConnection;

use super::super::types::{Failure, JobId, JobRow, JobState, REASON_ATTEMPTS_EXHAUSTED};
use super::super::{Result, retry};
use super::rows;

/// Where a job goes.
pub(super) enum Next {
    /// Done, with its result.
    Succeeded(Vec<u8>),
    /// Given up.
    Failed(Failure),
    /// Ended as asked.
    Cancelled,
    /// Back to the queue after a failed attempt, not to be given out before the time.
    Retry(Failure, i64),
    /// Back to its old place in the queue, the attempt not counted.
    Released,
}

/// After a failed attempt that might be repeated: cancelled if that was asked for, another attempt if one is left,
/// otherwise given up.
pub(super) fn after_failure(job: &JobRow, failure: Failure, now: i64) -> Next {
    if job.cancel_requested {
        Next::Cancelled
    } else if job.attempt < job.max_attempts {
        Next::Retry(failure, now.saturating_add(retry::backoff(job.attempt)))
    } else {
        let message = format!("all {} attempts failed; the last one: {}", job.attempt, failure.message);
        Next::Failed(Failure {
            reason: REASON_ATTEMPTS_EXHAUSTED,
            message,
        })
    }
}

/// Moves a job, ending its lease. The caller has checked that it may.
pub(super) async fn leave(db: &mut SqliteConnection, id: JobId, next: Next, now: i64) -> Result<JobRow> {
    let (state, result, failure, run_after, uncounted) = match next {
        Next::Succeeded(result) => (JobState::Succeeded, Some(result), None, None, 0),
        Next::Failed(failure) => (JobState::Failed, None, Some(failure), None, 0),
        Next::Cancelled => (JobState::Cancelled, None, None, None, 0),
        Next::Retry(failure, run_after) => (JobState::Queued, None, Some(failure), Some(run_after), 0),
        Next::Released => (JobState::Queued, None, None, None, 1),
    };
    let row = sqlx::query(
        "UPDATE jobs SET state = ?2, result = ?3, failure_reason = ?4, failure_message = ?5, run_after = ?6, \
         queue_time = coalesce(?6, create_time), attempt = attempt - ?7, end_time = ?8, update_time = ?9, \
         cancel_requested = 0, worker = NULL, lease_token = NULL, lease_expires = NULL, revision = revision + 1 \
         WHERE id = ?1 RETURNING *",
    )
    .bind(id.as_bytes().as_slice())
    .bind(state as i64)
    .bind(result)
    .bind(failure.as_ref().map(|f| f.reason))
    .bind(failure.as_ref().map(|f| f.message.as_str()))
    .bind(run_after)
    .bind(uncounted)
    .bind(state.is_over().then_some(now))
    .bind(now)
    .fetch_one(db)
    .await?;
    rows::job(&row)
}
