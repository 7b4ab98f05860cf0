//! Moves a job that leaves the queue or its worker: the one place where a row ends or is queued again, but
//! for jobs that a claim finds without attempts. Hooks that want to know hear of the end in the same transaction.

use super::super::transition::{Left, Next};
use super::super::types::{JobId, JobRow};
use super::super::{Result, codec};
use super::{DbConnection, hooks, rows, storable};

/// Moves a job, ending its lease. The caller has locked the row and checked that it may.
pub(super) async fn leave(db: &mut DbConnection, id: JobId, next: Next, now: i64) -> Result<JobRow> {
    let Left {
        state,
        result,
        failure,
        run_after,
        uncounted,
        end_time,
    } = next.row(now);
    let row = sqlx::query(
        "UPDATE jobs SET state = $2, result = $3, failure_reason = $4, failure_message = $5, run_after = $6, \
         queue_time = coalesce($6, create_time), attempt = attempt - $7, end_time = $8, update_time = $9, \
         cancel_requested = false, worker = NULL, lease_token = NULL, lease_expires = NULL, revision = revision + 1 \
         WHERE id = $1 RETURNING *",
    )
    .bind(id)
    .bind(state as i32)
    .bind(result.as_ref().map(codec::encode_result))
    .bind(failure.as_ref().map(|f| f.reason as i32))
    // The one text that programs write freely.
    .bind(failure.as_ref().map(|f| storable(&f.message)))
    .bind(run_after)
    .bind(uncounted)
    .bind(end_time)
    .bind(now)
    .fetch_one(&mut *db)
    .await?;
    let job = rows::job(&row)?;
    if job.state.is_over() {
        hooks::announce(db, &job, now).await?;
    }
    Ok(job)
}
