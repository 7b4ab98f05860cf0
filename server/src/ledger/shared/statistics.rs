//! What operators ask: counts, attempts, and another try.
use sqlx::postgres::PgRow;
use sqlx::{Connection, PgConnection, Row};
use uuid::Uuid;

use super::super::operations::{AttemptRow, OperationsLedger, Outcome, Running, Tally, Waiting, count};
use super::super::types::{ArtifactId, Failure, JobId, JobRow, JobState};
use super::super::{LedgerError, Result, numbers};
use super::{PostgresLedger, jobs, rows, with};

/// Queued jobs by kind.
pub(super) const QUEUED: &str =
    "SELECT kind, count(*) AS count, min(queue_time) AS since FROM jobs WHERE state = 1 GROUP BY kind";

/// Running jobs by kind. The sum is one without limits.
pub(super) const RUNNING: &str = "SELECT kind, count(*) AS count, \
    least(coalesce(sum(coalesce(likely_memory, memory)), 0), 9223372036854775807)::bigint AS memory \
    FROM jobs WHERE state = 2 GROUP BY kind";

/// Failed jobs by kind and reason.
pub(super) const FAILED: &str = "SELECT kind, coalesce(failure_reason, 0) AS reason, count(*) AS count \
    FROM jobs WHERE state = 4 GROUP BY kind, failure_reason";

/// A page of a project's jobs that failed for one of some reasons.
pub(super) const PAGE_OF_FAILED: &str = "SELECT * FROM jobs WHERE project = $4 AND state = 4 \
    AND coalesce(failure_reason, 0) = ANY($5) AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

#[tonic::async_trait]
impl OperationsLedger for PostgresLedger {
    async fn tally(&self) -> Result<Tally> {
        self.database.read(with!([] db => tally(db))).await
    }

    async fn list_failed(
        &self,
        project: &str,
        reasons: &[i32],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>> {
        let (project, reasons) = (project.to_owned(), reasons.to_vec());
        self.database
            .read(with!([project, reasons] db => list_failed(db, &project, &reasons, before, limit)))
            .await
    }

    async fn attempts(&self, job: JobId) -> Result<Vec<AttemptRow>> {
        self.database.read(with!([] db => attempts(db, job))).await
    }

    async fn requeue(&self, job: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow> {
        let inputs = inputs.to_vec();
        self.database
            .change(with!([inputs] db => requeue(db, job, &inputs, now)))
            .await
    }
}

async fn tally(db: &mut PgConnection) -> Result<Tally> {
    // One snapshot, so that no job is counted twice, or not at all.
    let mut db = db.begin_with("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY").await?;
    let mut tally = Tally::default();
    for row in sqlx::query(QUEUED).fetch_all(&mut *db).await? {
        tally.queued.push(Waiting {
            kind: numbers::job_kind(rows::number(&row, "kind")?)?,
            count: count(row.try_get("count")?),
            since: row.try_get("since")?,
        });
    }
    for row in sqlx::query(RUNNING).fetch_all(&mut *db).await? {
        tally.running.push(Running {
            kind: numbers::job_kind(rows::number(&row, "kind")?)?,
            count: count(row.try_get("count")?),
            memory: count(row.try_get("memory")?),
        });
    }
    for row in sqlx::query(FAILED).fetch_all(&mut *db).await? {
        let kind = numbers::job_kind(rows::number(&row, "kind")?)?;
        tally
            .failed
            .push((kind, row.try_get("reason")?, count(row.try_get("count")?)));
    }
    db.commit().await?;
    Ok(tally)
}

async fn list_failed(
    db: &mut PgConnection,
    project: &str,
    reasons: &[i32],
    before: Option<(i64, JobId)>,
    limit: u32,
) -> Result<Vec<JobRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(PAGE_OF_FAILED).bind(time).bind(id).bind(i64::from(limit));
    let found = query.bind(project).bind(reasons).fetch_all(db).await?;
    found.iter().map(rows::job).collect()
}

async fn attempts(db: &mut PgConnection, job: JobId) -> Result<Vec<AttemptRow>> {
    let query = sqlx::query("SELECT * FROM job_attempts WHERE job_id = $1 ORDER BY number DESC");
    query.bind(job).fetch_all(db).await?.iter().map(attempt).collect()
}

async fn requeue(db: &mut PgConnection, id: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow> {
    let row = jobs::locked(db, id).await?.ok_or_else(|| LedgerError::no_job(id))?;
    let job = rows::job(&row)?;
    if job.state != JobState::Failed {
        return Err(LedgerError::NotFailed(id));
    }
    jobs::inputs_are_there(db, &job.project, inputs).await?;
    let queued = sqlx::query(
        "UPDATE jobs SET state = 1, attempt = 0, progress = NULL, failure_reason = NULL, failure_message = NULL, \
         end_time = NULL, run_after = NULL, queue_time = $2, update_time = $2, revision = revision + 1 \
         WHERE id = $1 RETURNING *",
    );
    rows::job(&queued.bind(id).bind(now).fetch_one(db).await?)
}

fn attempt(row: &PgRow) -> Result<AttemptRow> {
    let reason: Option<i32> = row.try_get("failure_reason")?;
    let message: Option<String> = row.try_get("failure_message")?;
    Ok(AttemptRow {
        number: row.try_get("number")?,
        worker: row.try_get("worker")?,
        start_time: row.try_get("start_time")?,
        end_time: row.try_get("end_time")?,
        outcome: Outcome::from_number(rows::number(row, "outcome")?)?,
        failure: reason.zip(message).map(|(reason, message)| Failure { reason, message }),
    })
}
