//! The order of the queue, and who takes jobs.
use std::time::Duration;

use sqlx::{Row, SqliteConnection};

use super::super::queue::PATIENCE;
use super::super::transition::{end_of, micros};
use super::super::types::{FailureReason, JobId, JobRow, JobState, Lease};
use super::super::workers::WorkerCapabilities;
use super::super::{Result, token};
use super::{hooks, rows};

/// One statement takes the next job that the worker can hold, and either counts an attempt and leases it, or fails it
/// because no attempt is left. So a job that kills its worker is bounded even if nobody lives to tell.
///
/// It goes from lane to lane (`lane`), finds the first job of each (`head`), and sorts those few. Left alone, the
/// planner would read all queued jobs by another index; hence `INDEXED BY`. The next
/// lane is looked for in two steps, because a comparison of pairs would have all of the lane read.
pub(super) const CLAIM: &str = "UPDATE jobs SET \
    state = iif(attempt < max_attempts, 2, 4), \
    worker = iif(attempt < max_attempts, $1, NULL), \
    lease_token = iif(attempt < max_attempts, $2, NULL), \
    lease_expires = iif(attempt < max_attempts, $3, NULL), \
    start_time = iif(attempt < max_attempts, $4, start_time), \
    end_time = iif(attempt < max_attempts, NULL, $4), \
    progress = iif(attempt < max_attempts, NULL, progress), \
    failure_reason = iif(attempt < max_attempts, NULL, $5), \
    failure_message = iif(attempt < max_attempts, NULL, 'no attempt is left' || coalesce('; ' || failure_message, '')), \
    attempt = attempt + iif(attempt < max_attempts, 1, 0), \
    run_after = NULL, update_time = $4, revision = revision + 1 \
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
            AND (run_after IS NULL OR run_after <= $4) \
            AND ($7 IS NULL OR memory IS NULL OR memory <= $7) \
            AND ($8 IS NULL OR likely_memory IS NULL OR likely_memory <= $8) \
            AND ($9 IS NULL OR clip IS NULL OR instr($9, clip) > 0) \
            ORDER BY queue_time, id LIMIT 1) AS place FROM lane), \
        running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs INDEXED BY jobs_leases WHERE state = 2 \
            GROUP BY project), \
        ready AS MATERIALIZED (SELECT j.rowid AS place, j.queue_time, j.id, j.priority, \
            iif(j.queue_time <= $6, coalesce((SELECT max(start_time) FROM jobs s INDEXED BY jobs_by_start \
                WHERE s.project = j.project AND s.priority = j.priority AND s.start_time IS NOT NULL), $6) <= $6, 0) \
                AS starved, \
            coalesce(running.jobs, 0) AS running \
            FROM head CROSS JOIN jobs j ON j.rowid = head.place LEFT JOIN running ON running.project = j.project) \
        SELECT place FROM ready \
        ORDER BY starved DESC, iif(starved, 0, -priority), iif(starved, 0, running), queue_time, id LIMIT 1) \
    RETURNING *";

/// The whole queue in its order; [`POSITION`] counts in the same.
pub(super) const QUEUE: &str = "WITH \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs INDEXED BY jobs_leases WHERE state = 2 \
        GROUP BY project), \
    turns AS (SELECT q.id, q.priority, q.queue_time, coalesce(r.jobs, 0) + \
        row_number() OVER (PARTITION BY q.project ORDER BY q.priority DESC, q.queue_time, q.id) AS turn \
        FROM jobs q INDEXED BY jobs_queue LEFT JOIN running r ON r.project = q.project WHERE q.state = 1) \
    SELECT id FROM turns ORDER BY priority DESC, turn, queue_time, id";

/// Queued jobs before the one with a project, a priority, a time and an id. Of each project there are `urgent` jobs in
/// lanes of higher priorities, `same` in the lane of the job's priority, and `older` in front of the job's place among
/// these. A job's `turn` is how many jobs its project has running, or will have by then: of one priority jobs of lower
/// turns go first, and of one turn the oldest.
pub(super) const POSITION: &str = "WITH \
    side AS (SELECT project, sum(priority > $2) AS urgent, sum(priority = $2) AS same, \
        sum(priority = $2 AND (queue_time, id) < ($3, $4)) AS older \
        FROM jobs INDEXED BY jobs_queue WHERE state = 1 AND priority >= $2 GROUP BY project), \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs INDEXED BY jobs_leases WHERE state = 2 \
        GROUP BY project), \
    turns AS MATERIALIZED (SELECT side.*, urgent + coalesce(running.jobs, 0) AS first \
        FROM side LEFT JOIN running ON running.project = side.project), \
    own AS MATERIALIZED (SELECT first + older AS turn FROM turns WHERE project = $1) \
    SELECT sum(urgent + max(0, min(same, own.turn - first)) + (own.turn >= first AND own.turn - first < older)) \
    FROM own CROSS JOIN turns";

pub(super) async fn claim(
    db: &mut SqliteConnection,
    capabilities: &WorkerCapabilities,
    lease: Duration,
    now: i64,
) -> Result<Option<Lease>> {
    let token = token::fresh();
    // Each is of one length, and none is a part of two.
    let clips = capabilities.clips().map(|clips| clips.join(" "));
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

pub(super) async fn all(db: &mut SqliteConnection) -> Result<Vec<JobId>> {
    Ok(sqlx::query_scalar(QUEUE).fetch_all(db).await?)
}

/// A job with its position in the queue.
pub(super) async fn get(db: &mut SqliteConnection, id: JobId) -> Result<Option<JobRow>> {
    let query = sqlx::query("SELECT * FROM jobs WHERE id = $1").bind(id);
    let Some(row) = query.fetch_optional(&mut *db).await? else {
        return Ok(None);
    };
    let mut job = rows::job(&row)?;
    if job.state == JobState::Queued {
        // One that leaves the queue in between has none any more.
        job.queue_position = sqlx::query_scalar(POSITION)
            .bind(&job.project)
            .bind(job.priority)
            .bind(row.try_get::<i64, _>("queue_time")?)
            .bind(id)
            .fetch_one(db)
            .await?;
    }
    Ok(Some(job))
}
