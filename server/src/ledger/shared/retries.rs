//! Jobs that failed, their attempts, and another try.
use sqlx::Row;
use uuid::Uuid;

use super::super::jobs::{AttemptRow, Outcome, bits};
use super::super::types::{ArtifactId, FailureReason, JobId, JobRow, JobState};
use super::super::{LedgerError, Result};
use super::{DbConnection, DbRow, inputs, jobs, rows};

/// A page of a project's jobs that failed for one of the reasons whose bits are set.
pub(super) const PAGE_OF_FAILED: &str = "SELECT * FROM jobs WHERE project = $4 AND state = 4 \
    AND (($5 >> coalesce(failure_reason, 0)) & 1) = 1 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

pub(super) async fn list_failed(
    db: &mut DbConnection,
    project: &str,
    reasons: &[FailureReason],
    before: Option<(i64, JobId)>,
    limit: u32,
) -> Result<Vec<JobRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(PAGE_OF_FAILED).bind(time).bind(id).bind(i64::from(limit));
    let found = query.bind(project).bind(bits(reasons)).fetch_all(db).await?;
    found.iter().map(rows::job).collect()
}

pub(super) async fn attempts(db: &mut DbConnection, job: JobId) -> Result<Vec<AttemptRow>> {
    let query = sqlx::query("SELECT * FROM job_attempts WHERE job_id = $1 ORDER BY number DESC");
    query.bind(job).fetch_all(db).await?.iter().map(attempt).collect()
}

pub(super) async fn requeue(db: &mut DbConnection, id: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow> {
    let row = jobs::locked(db, id).await?.ok_or_else(|| LedgerError::no_job(id))?;
    let job = rows::job(&row)?;
    if job.state != JobState::Failed {
        return Err(LedgerError::NotFailed(id));
    }
    inputs::hold(db, &job.project, inputs).await?;
    let queued = sqlx::query(
        "UPDATE jobs SET state = 1, attempt = 0, progress = NULL, failure_reason = NULL, failure_message = NULL, \
         end_time = NULL, run_after = NULL, queue_time = $2, update_time = $2, revision = revision + 1 \
         WHERE id = $1 RETURNING *",
    );
    rows::job(&queued.bind(id).bind(now).fetch_one(db).await?)
}

fn attempt(row: &DbRow) -> Result<AttemptRow> {
    Ok(AttemptRow {
        number: row.try_get("number")?,
        worker: row.try_get("worker")?,
        start_time: row.try_get("start_time")?,
        end_time: row.try_get("end_time")?,
        outcome: Outcome::from_number(rows::number(row, "outcome")?)?,
        failure: rows::failure(row)?,
    })
}
