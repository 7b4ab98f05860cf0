//! The order of the queue, and who takes jobs.
use std::time::Duration;

use sqlx::PgConnection;

use super::super::queue::{FORGOTTEN, PATIENCE, QueueLedger, SeenWorker, Taker};
use super::super::transition::{end_of, micros};
use super::super::types::{JobId, JobRow, JobState, Lease, REASON_ATTEMPTS_EXHAUSTED};
use super::super::{Result, token};
use super::{PostgresLedger, hooks, jobs, rows, with};

/// One statement takes the next job that the worker can hold and that nobody else is taking, and either counts an
/// attempt and leases it, or fails it because no attempt is left. So a job that kills its worker is bounded even if
/// nobody lives to tell.
///
/// It walks from lane to lane (`lane`), and sorts them by their first jobs (`ranked`). Then it goes through the lanes in
/// that order and locks the first job that is free. There is no `ORDER BY` behind that: it would have a job of every lane
/// locked first, and other claims would pass over them.
pub(super) const CLAIM: &str = "WITH RECURSIVE \
    lane(project, priority) AS (\
        (SELECT project, priority FROM jobs WHERE state = 1 ORDER BY project, priority LIMIT 1) \
        UNION ALL \
        SELECT q.project, q.priority FROM lane CROSS JOIN LATERAL (\
            SELECT project, priority FROM jobs \
            WHERE state = 1 AND (project, priority) > (lane.project, lane.priority) \
            ORDER BY project, priority LIMIT 1) q), \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs WHERE state = 2 GROUP BY project), \
    ranked AS MATERIALIZED (\
        SELECT lane.project AS of_project, lane.priority AS of_priority FROM lane CROSS JOIN LATERAL (\
            SELECT queue_time, id FROM jobs \
            WHERE state = 1 AND project = lane.project AND priority = lane.priority \
            AND (run_after IS NULL OR run_after <= $4) \
            AND ($7::bigint IS NULL OR memory IS NULL OR memory <= $7) \
            AND ($8::bigint IS NULL OR likely_memory IS NULL OR likely_memory <= $8) \
            AND ($9::text[] IS NULL OR clip IS NULL OR clip = ANY($9)) \
            ORDER BY queue_time, id LIMIT 1) head CROSS JOIN LATERAL (\
            SELECT head.queue_time <= $6 AND coalesce((SELECT max(start_time) FROM jobs \
                WHERE project = lane.project AND priority = lane.priority), $6) <= $6 AS starved OFFSET 0) of_lane \
            LEFT JOIN running ON running.project = lane.project \
        ORDER BY starved DESC, CASE WHEN starved THEN 0 ELSE -lane.priority END, \
            CASE WHEN starved THEN 0 ELSE coalesce(running.jobs, 0) END, head.queue_time, head.id), \
    next AS MATERIALIZED (\
        SELECT next_id, may FROM ranked CROSS JOIN LATERAL (\
            SELECT id AS next_id, attempt < max_attempts AS may FROM jobs \
            WHERE state = 1 AND project = of_project AND priority = of_priority \
            AND (run_after IS NULL OR run_after <= $4) \
            AND ($7::bigint IS NULL OR memory IS NULL OR memory <= $7) \
            AND ($8::bigint IS NULL OR likely_memory IS NULL OR likely_memory <= $8) \
            AND ($9::text[] IS NULL OR clip IS NULL OR clip = ANY($9)) \
            ORDER BY queue_time, id LIMIT 1 FOR UPDATE SKIP LOCKED) free LIMIT 1) \
    UPDATE jobs SET \
    state = CASE WHEN may THEN 2 ELSE 4 END, \
    worker = CASE WHEN may THEN $1 END, \
    lease_token = CASE WHEN may THEN $2 END, \
    lease_expires = CASE WHEN may THEN $3 END, \
    start_time = CASE WHEN may THEN $4 ELSE start_time END, \
    end_time = CASE WHEN may THEN NULL ELSE $4 END, \
    progress = CASE WHEN may THEN NULL ELSE progress END, \
    failure_reason = CASE WHEN may THEN NULL ELSE $5 END, \
    failure_message = CASE WHEN may THEN NULL ELSE 'no attempt is left' || coalesce('; ' || failure_message, '') END, \
    attempt = attempt + CASE WHEN may THEN 1 ELSE 0 END, \
    run_after = NULL, update_time = $4, revision = revision + 1 \
    FROM next WHERE id = next_id RETURNING *";

/// The whole queue in its order; [`GET`](super::jobs::GET) counts in the same.
pub(super) const QUEUE: &str = "WITH \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs WHERE state = 2 GROUP BY project), \
    turns AS (SELECT id, priority, queue_time, coalesce(running.jobs, 0) + \
        row_number() OVER (PARTITION BY project ORDER BY priority DESC, queue_time, id) AS turn \
        FROM jobs LEFT JOIN running USING (project) WHERE state = 1) \
    SELECT id FROM turns ORDER BY priority DESC, turn, queue_time, id";

#[tonic::async_trait]
impl QueueLedger for PostgresLedger {
    async fn claim_for(&self, taker: &Taker, lease: Duration, now: i64) -> Result<Option<Lease>> {
        let taker = taker.clone();
        self.database
            .change(with!([taker] db => claim(db, &taker, lease, now)))
            .await
    }

    async fn note_worker(&self, worker: SeenWorker, now: i64) -> Result<()> {
        self.database.change(with!([worker] db => note(db, &worker, now))).await
    }

    async fn workers_since(&self, since: i64) -> Result<Vec<SeenWorker>> {
        self.database.read(with!([] db => workers(db, since))).await
    }

    async fn peek_job(&self, id: JobId) -> Result<Option<JobRow>> {
        self.database.read(with!([] db => jobs::peek(db, id))).await
    }

    async fn queue(&self) -> Result<Vec<JobId>> {
        self.database.read(with!([] db => all(db))).await
    }
}

async fn claim(db: &mut PgConnection, taker: &Taker, lease: Duration, now: i64) -> Result<Option<Lease>> {
    let token = token::fresh();
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
            .bind(taker.clips())
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

async fn note(db: &mut PgConnection, worker: &SeenWorker, now: i64) -> Result<()> {
    let note = sqlx::query(
        "INSERT INTO seen_workers (name, device, memory, clips, time) VALUES ($1, $2, $3, $4, $5) \
         ON CONFLICT (name) DO UPDATE SET device = $2, memory = $3, clips = $4, \
         time = greatest(seen_workers.time, $5)",
    );
    note.bind(&worker.name)
        .bind(&worker.device)
        .bind(worker.memory)
        .bind(worker.clips.join(" "))
        .bind(now)
        .execute(&mut *db)
        .await?;
    // Others may be at the same rows: whoever comes first forgets them.
    let forget = sqlx::query(
        "DELETE FROM seen_workers WHERE name IN (SELECT name FROM seen_workers WHERE time < $1 FOR UPDATE SKIP LOCKED)",
    );
    forget.bind(now.saturating_sub(FORGOTTEN)).execute(db).await?;
    Ok(())
}

async fn workers(db: &mut PgConnection, since: i64) -> Result<Vec<SeenWorker>> {
    let query = sqlx::query(
        "SELECT * FROM seen_workers WHERE time >= $1 \
         OR name IN (SELECT worker FROM jobs WHERE state = 2) ORDER BY name",
    );
    let seen = query.bind(since).fetch_all(db).await?;
    seen.iter().map(rows::worker).collect()
}

pub(super) async fn all(db: &mut PgConnection) -> Result<Vec<JobId>> {
    Ok(sqlx::query_scalar(QUEUE).fetch_all(db).await?)
}
