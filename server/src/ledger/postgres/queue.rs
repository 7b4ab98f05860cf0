//! The order of the queue, and who takes jobs.
use std::time::Duration;

use sqlx::{PgConnection, Row};

use super::super::queue::PATIENCE;
use super::super::transition::{end_of, micros};
use super::super::types::{FailureReason, JobId, JobRow, JobState, Lease};
use super::super::workers::WorkerCapabilities;
use super::super::{Result, token};
use super::{hooks, rows};

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

/// The whole queue in its order; [`GET`] counts in the same.
pub(super) const QUEUE: &str = "WITH \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs WHERE state = 2 GROUP BY project), \
    turns AS (SELECT id, priority, queue_time, coalesce(running.jobs, 0) + \
        row_number() OVER (PARTITION BY project ORDER BY priority DESC, queue_time, id) AS turn \
        FROM jobs LEFT JOIN running USING (project) WHERE state = 1) \
    SELECT id FROM turns ORDER BY priority DESC, turn, queue_time, id";

/// A job and the queued jobs before it. Of each project there are `urgent` jobs in lanes of higher priorities, `same` in
/// the lane of the job's own, and `older` in front of the job's place among these. A job's `turn` is how many jobs its
/// project has running, or will have by then: of one priority jobs of lower turns go first, and of one turn the oldest.
pub(super) const GET: &str = "WITH \
    job AS (SELECT * FROM jobs WHERE id = $1), \
    side AS MATERIALIZED (SELECT q.project, count(*) FILTER (WHERE q.priority > j.priority) AS urgent, \
        count(*) FILTER (WHERE q.priority = j.priority) AS same, \
        count(*) FILTER (WHERE q.priority = j.priority AND (q.queue_time, q.id) < (j.queue_time, j.id)) AS older \
        FROM job j CROSS JOIN jobs q WHERE j.state = 1 AND q.state = 1 AND q.priority >= j.priority GROUP BY q.project), \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs WHERE state = 2 GROUP BY project), \
    turns AS MATERIALIZED (SELECT side.*, urgent + coalesce(running.jobs, 0) AS first \
        FROM side LEFT JOIN running USING (project)) \
    SELECT j.*, (SELECT sum(urgent + greatest(0, least(same, own.turn - first)) \
        + CASE WHEN own.turn >= first AND own.turn - first < older THEN 1 ELSE 0 END)::bigint \
        FROM turns, (SELECT first + older AS turn FROM turns WHERE project = (SELECT project FROM job)) AS own \
        ) AS queue_position FROM job j";

pub(super) async fn claim(
    db: &mut PgConnection,
    capabilities: &WorkerCapabilities,
    lease: Duration,
    now: i64,
) -> Result<Option<Lease>> {
    let token = token::fresh();
    loop {
        let row = sqlx::query(CLAIM)
            .bind(&capabilities.worker)
            .bind(token::hash(&token))
            .bind(end_of(lease, now))
            .bind(now)
            .bind(FailureReason::AttemptsExhausted as i32)
            .bind(now.saturating_sub(micros(PATIENCE)))
            .bind(capabilities.memory)
            .bind(capabilities.likely_memory)
            .bind(capabilities.clips())
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

pub(super) async fn all(db: &mut PgConnection) -> Result<Vec<JobId>> {
    Ok(sqlx::query_scalar(QUEUE).fetch_all(db).await?)
}

/// A job with its position in the queue.
pub(super) async fn get(db: &mut PgConnection, id: JobId) -> Result<Option<JobRow>> {
    let row = sqlx::query(GET).bind(id).fetch_optional(db).await?;
    row.map(|row| {
        Ok(JobRow {
            queue_position: row.try_get("queue_position")?,
            ..rows::job(&row)?
        })
    })
    .transpose()
}
