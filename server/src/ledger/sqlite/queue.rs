//! The order of the queue, and who takes jobs.
use std::time::Duration;

use sqlx::SqliteConnection;

use super::super::queue::{FORGOTTEN, PATIENCE, QueueLedger, SeenWorker, Taker};
use super::super::transition::{end_of, micros};
use super::super::types::{JobId, JobRow, JobState, Lease, REASON_ATTEMPTS_EXHAUSTED};
use super::super::{Result, token};
use super::{SqliteLedger, hooks, jobs, rows};

/// One statement takes the next job that the worker can hold, and either counts an attempt and leases it, or fails it
/// because no attempt is left. So a job that kills its worker is bounded even if nobody lives to tell.
///
/// It walks from lane to lane (`lane`), finds the first job of each (`head`), and sorts those few. Left alone, the
/// planner would read all queued jobs by another index; hence `INDEXED BY`. The next
/// lane is looked for in two steps, because a comparison of pairs would have all of the lane read.
pub(super) const CLAIM: &str = "UPDATE jobs SET \
    state = iif(attempt < max_attempts, 2, 4), \
    worker = iif(attempt < max_attempts, ?1, NULL), \
    lease_token = iif(attempt < max_attempts, ?2, NULL), \
    lease_expires = iif(attempt < max_attempts, ?3, NULL), \
    start_time = iif(attempt < max_attempts, ?4, start_time), \
    end_time = iif(attempt < max_attempts, NULL, ?4), \
    progress = iif(attempt < max_attempts, NULL, progress), \
    failure_reason = iif(attempt < max_attempts, NULL, ?5), \
    failure_message = iif(attempt < max_attempts, NULL, 'no attempt is left' || coalesce('; ' || failure_message, '')), \
    attempt = attempt + iif(attempt < max_attempts, 1, 0), \
    run_after = NULL, update_time = ?4, revision = revision + 1 \
    WHERE rowid = (WITH RECURSIVE \
        lane(project, priority) AS (\
            SELECT * FROM (SELECT project, priority FROM jobs INDEXED BY jobs_queue WHERE state = 1 \
                ORDER BY project, priority LIMIT 1) \
            UNION ALL \
            SELECT j.project, j.priority FROM lane CROSS JOIN jobs j ON j.rowid = coalesce(\
                (SELECT rowid FROM jobs INDEXED BY jobs_queue \
                WHERE state = 1 AND project = lane.project AND priority > lane.priority \
                ORDER BY priority LIMIT 1), \
                (SELECT rowid FROM jobs INDEXED BY jobs_queue WHERE state = 1 AND project > lane.project \
                ORDER BY project, priority LIMIT 1))), \
        head AS MATERIALIZED (SELECT (\
            SELECT rowid FROM jobs INDEXED BY jobs_queue \
            WHERE state = 1 AND project = lane.project AND priority = lane.priority \
            AND (run_after IS NULL OR run_after <= ?4) \
            AND (?7 IS NULL OR memory IS NULL OR memory <= ?7) \
            AND (?8 IS NULL OR likely_memory IS NULL OR likely_memory <= ?8) \
            AND (?9 IS NULL OR clip IS NULL OR instr(?9, clip) > 0) \
            ORDER BY queue_time, id LIMIT 1) AS place FROM lane), \
        running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs INDEXED BY jobs_leases WHERE state = 2 \
            GROUP BY project), \
        ready AS MATERIALIZED (SELECT j.rowid AS place, j.queue_time, j.id, j.priority, \
            iif(j.queue_time <= ?6, coalesce((SELECT max(start_time) FROM jobs s INDEXED BY jobs_by_start \
                WHERE s.project = j.project AND s.priority = j.priority AND s.start_time IS NOT NULL), ?6) <= ?6, 0) \
                AS starved, \
            coalesce(running.jobs, 0) AS running \
            FROM head CROSS JOIN jobs j ON j.rowid = head.place LEFT JOIN running ON running.project = j.project) \
        SELECT place FROM ready \
        ORDER BY starved DESC, iif(starved, 0, -priority), iif(starved, 0, running), queue_time, id LIMIT 1) \
    RETURNING *";

/// The whole queue in its order; [`POSITION`](super::jobs::POSITION) counts in the same.
pub(super) const QUEUE: &str = "WITH \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs INDEXED BY jobs_leases WHERE state = 2 \
        GROUP BY project), \
    turns AS (SELECT q.id, q.priority, q.queue_time, coalesce(r.jobs, 0) + \
        row_number() OVER (PARTITION BY q.project ORDER BY q.priority DESC, q.queue_time, q.id) AS turn \
        FROM jobs q INDEXED BY jobs_queue LEFT JOIN running r ON r.project = q.project WHERE q.state = 1) \
    SELECT id FROM turns ORDER BY priority DESC, turn, queue_time, id";

#[tonic::async_trait]
impl QueueLedger for SqliteLedger {
    async fn claim_for(&self, taker: &Taker, lease: Duration, now: i64) -> Result<Option<Lease>> {
        let taker = taker.clone();
        self.writer.run(move |db| Box::pin(claim(db, taker, lease, now))).await
    }

    async fn note_worker(&self, worker: SeenWorker, now: i64) -> Result<()> {
        self.writer.run(move |db| Box::pin(note(db, worker, now))).await
    }

    async fn workers_since(&self, since: i64) -> Result<Vec<SeenWorker>> {
        let query = sqlx::query(
            "SELECT * FROM seen_workers WHERE time >= ?1 \
             OR name IN (SELECT worker FROM jobs INDEXED BY jobs_leases WHERE state = 2) ORDER BY name",
        );
        let seen = query.bind(since).fetch_all(&self.readers).await?;
        seen.iter().map(rows::worker).collect()
    }

    async fn peek_job(&self, id: JobId) -> Result<Option<JobRow>> {
        let row = jobs::by_id(&mut *self.readers.acquire().await?, id).await?;
        row.as_ref().map(rows::job).transpose()
    }

    async fn queue(&self) -> Result<Vec<JobId>> {
        all(&mut *self.readers.acquire().await?).await
    }
}

async fn claim(db: &mut SqliteConnection, taker: Taker, lease: Duration, now: i64) -> Result<Option<Lease>> {
    let token = token::fresh();
    // Each is of one length, and none is a part of two.
    let clips = taker.clips().map(|clips| clips.join(" "));
    loop {
        let row = sqlx::query(CLAIM)
            .bind(&taker.worker)
            .bind(token::hash(&token))
            .bind(end_of(lease, now))
            .bind(now)
            .bind(REASON_ATTEMPTS_EXHAUSTED)
            .bind(now.saturating_sub(micros(PATIENCE)))
            .bind(taker.memory)
            .bind(taker.likely_memory)
            .bind(&clips)
            .fetch_optional(&mut *db)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let job = rows::job(&row)?;
        if job.state == JobState::Running {
            return Ok(Some(Lease { job, token }));
        }
        hooks::announce(db, &job, now).await?;
    }
}

async fn note(db: &mut SqliteConnection, worker: SeenWorker, now: i64) -> Result<()> {
    let note = sqlx::query(
        "INSERT INTO seen_workers (name, device, memory, clips, time) VALUES (?1, ?2, ?3, ?4, ?5) \
         ON CONFLICT (name) DO UPDATE SET device = ?2, memory = ?3, clips = ?4, time = max(time, ?5)",
    );
    note.bind(worker.name)
        .bind(worker.device)
        .bind(worker.memory)
        .bind(worker.clips.join(" "))
        .bind(now)
        .execute(&mut *db)
        .await?;
    let forget = sqlx::query("DELETE FROM seen_workers WHERE time < ?1");
    forget.bind(now.saturating_sub(FORGOTTEN)).execute(db).await?;
    Ok(())
}

pub(super) async fn all(db: &mut SqliteConnection) -> Result<Vec<JobId>> {
    let queue = sqlx::query(QUEUE).fetch_all(db).await?;
    queue.iter().map(|row| rows::id(row, "id")).collect()
}
