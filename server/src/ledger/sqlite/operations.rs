//! What operators ask: counts, attempts, and another try.
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};
use uuid::Uuid;

use super::super::operations::{AttemptRow, OperationsLedger, Outcome, Running, Tally, Waiting, bits, count};
use super::super::types::{ArtifactId, Failure, JobId, JobRow, JobState};
use super::super::{LedgerError, Result, numbers};
use super::{SqliteLedger, jobs, rows};

/// Queued jobs by kind. `INDEXED BY` as in `CLAIM`: what is queued is little among all there is.
pub(super) const QUEUED: &str = "SELECT kind, count(*) AS count, min(queue_time) AS since \
    FROM jobs INDEXED BY jobs_queue WHERE state = 1 GROUP BY kind";

/// Running jobs by kind. The sum is one of floating point, which does not overflow.
pub(super) const RUNNING: &str = "SELECT kind, count(*) AS count, \
    CAST(total(coalesce(likely_memory, memory)) AS INTEGER) AS memory \
    FROM jobs INDEXED BY jobs_leases WHERE state = 2 GROUP BY kind";

/// Failed jobs by kind and reason, from the index alone.
pub(super) const FAILED: &str = "SELECT kind, coalesce(failure_reason, 0) AS reason, count(*) AS count \
    FROM jobs INDEXED BY jobs_failed WHERE state = 4 GROUP BY kind, failure_reason";

/// A page of a project's jobs that failed for one of the reasons whose bits are set.
pub(super) const PAGE_OF_FAILED: &str = "SELECT * FROM jobs WHERE project = ?4 AND state = 4 \
    AND (?5 >> coalesce(failure_reason, 0)) & 1 AND (create_time, id) < (?1, ?2) \
    ORDER BY create_time DESC, id DESC LIMIT ?3";

#[tonic::async_trait]
impl OperationsLedger for SqliteLedger {
    async fn tally(&self) -> Result<Tally> {
        let mut snapshot = self.readers.begin().await?;
        let db = &mut *snapshot;
        let mut tally = Tally::default();
        for row in sqlx::query(QUEUED).fetch_all(&mut *db).await? {
            tally.queued.push(Waiting {
                kind: numbers::job_kind(row.try_get("kind")?)?,
                count: count(row.try_get("count")?),
                since: row.try_get("since")?,
            });
        }
        for row in sqlx::query(RUNNING).fetch_all(&mut *db).await? {
            tally.running.push(Running {
                kind: numbers::job_kind(row.try_get("kind")?)?,
                count: count(row.try_get("count")?),
                memory: count(row.try_get("memory")?),
            });
        }
        for row in sqlx::query(FAILED).fetch_all(&mut *db).await? {
            let kind = numbers::job_kind(row.try_get("kind")?)?;
            tally
                .failed
                .push((kind, row.try_get("reason")?, count(row.try_get("count")?)));
        }
        Ok(tally)
    }

    async fn list_failed(
        &self,
        project: &str,
        reasons: &[i32],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>> {
        let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
        let query = sqlx::query(PAGE_OF_FAILED)
            .bind(time)
            .bind(id.as_bytes().as_slice())
            .bind(limit)
            .bind(project)
            .bind(bits(reasons));
        let found = query.fetch_all(&mut *self.readers.acquire().await?).await?;
        found.iter().map(rows::job).collect()
    }

    async fn attempts(&self, job: JobId) -> Result<Vec<AttemptRow>> {
        let query = sqlx::query("SELECT * FROM job_attempts WHERE job_id = ?1 ORDER BY number DESC");
        let query = query.bind(job.as_bytes().as_slice());
        let found = query.fetch_all(&mut *self.readers.acquire().await?).await?;
        found.iter().map(attempt).collect()
    }

    async fn requeue(&self, job: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow> {
        let inputs = inputs.to_vec();
        self.writer
            .run(move |db| Box::pin(async move { requeue(db, job, &inputs, now).await }))
            .await
    }
}

async fn requeue(db: &mut SqliteConnection, id: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow> {
    let row = jobs::by_id(db, id).await?.ok_or_else(|| LedgerError::no_job(id))?;
    let job = rows::job(&row)?;
    if job.state != JobState::Failed {
        return Err(LedgerError::NotFailed(id));
    }
    jobs::inputs_are_there(db, &job.project, inputs).await?;
    let queued = sqlx::query(
        "UPDATE jobs SET state = 1, attempt = 0, progress = NULL, failure_reason = NULL, failure_message = NULL, \
         end_time = NULL, run_after = NULL, queue_time = ?2, update_time = ?2, revision = revision + 1 \
         WHERE id = ?1 RETURNING *",
    );
    rows::job(&queued.bind(id.as_bytes().as_slice()).bind(now).fetch_one(db).await?)
}

fn attempt(row: &SqliteRow) -> Result<AttemptRow> {
    let reason: Option<i32> = row.try_get("failure_reason")?;
    let message: Option<String> = row.try_get("failure_message")?;
    Ok(AttemptRow {
        number: row.try_get("number")?,
        worker: row.try_get("worker")?,
        start_time: row.try_get("start_time")?,
        end_time: row.try_get("end_time")?,
        outcome: Outcome::from_number(row.try_get("outcome")?)?,
        failure: reason.zip(message).map(|(reason, message)| Failure { reason, message }),
    })
}
