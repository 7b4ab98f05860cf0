//! Jobs as their owners see them: made, looked at, listed, cancelled.
use std::collections::HashMap;

use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};
use uuid::Uuid;

use super::super::transition::{self, Cancel, Next};
use super::super::types::{ArtifactId, JobId, JobRow, JobState, NewJob};
use super::super::{LedgerError, Result, again};
use super::transition::leave;
use super::{queue, rows};

/// Queued jobs before the one with a project, a priority, a time and an id. Of each project there are `urgent` jobs in
/// lanes of higher priorities, `same` in the lane of the job's priority, and `older` in front of the job's place among
/// these. A job's `turn` is how many jobs its project has running, or will have by then: of one priority jobs of lower
/// turns go first, and of one turn the oldest.
pub(super) const POSITION: &str = "WITH \
    side AS (SELECT project, sum(priority > ?2) AS urgent, sum(priority = ?2) AS same, \
        sum(priority = ?2 AND (queue_time, id) < (?3, ?4)) AS older \
        FROM jobs INDEXED BY jobs_queue WHERE state = 1 AND priority >= ?2 GROUP BY project), \
    running AS MATERIALIZED (SELECT project, count(*) AS jobs FROM jobs INDEXED BY jobs_leases WHERE state = 2 \
        GROUP BY project), \
    turns AS MATERIALIZED (SELECT side.*, urgent + coalesce(running.jobs, 0) AS first \
        FROM side LEFT JOIN running ON running.project = side.project), \
    own AS MATERIALIZED (SELECT first + older AS turn FROM turns WHERE project = ?1) \
    SELECT sum(urgent + max(0, min(same, own.turn - first)) + (own.turn >= first AND own.turn - first < older)) \
    FROM own CROSS JOIN turns";

/// A page of a project's jobs.
pub(super) const PAGE: &str = "SELECT * FROM jobs WHERE project = ?4 AND (create_time, id) < (?1, ?2) ORDER BY create_time DESC, id DESC LIMIT ?3";

/// A page of those in one state.
pub(super) const PAGE_OF_STATE: &str = "SELECT * FROM jobs WHERE project = ?4 AND state = ?5 AND (create_time, id) < (?1, ?2) \
    ORDER BY create_time DESC, id DESC LIMIT ?3";

pub(super) async fn create(db: &mut SqliteConnection, new: NewJob, now: i64) -> Result<JobRow> {
    if let Some(request) = new.request_id
        && let Some(row) = by_request(db, request).await?
    {
        let fingerprint: Vec<u8> = row.try_get("fingerprint")?;
        return again::job(request, rows::job(&row)?, &fingerprint, &new);
    }
    inputs_are_there(db, &new.project, &new.inputs).await?;
    if let Some(key) = new.key {
        let there = sqlx::query("SELECT 1 FROM keys WHERE id = ?1 AND project = ?2")
            .bind(key.as_bytes().as_slice())
            .bind(&new.project);
        there
            .fetch_optional(&mut *db)
            .await?
            .ok_or(LedgerError::NotFound { kind: "key", id: key })?;
    }
    let row = sqlx::query(
        "INSERT INTO jobs (id, display_name, kind, spec, key_id, request_id, fingerprint, state, max_attempts, \
         create_time, update_time, queue_time, project, priority, memory, likely_memory, clip, trace_parent, asked_id) \
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, 1, ?8, ?9, ?9, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16) RETURNING *",
    )
    .bind(new.id.as_bytes().as_slice())
    .bind(&new.display_name)
    .bind(new.kind as i64)
    .bind(&new.spec)
    .bind(new.key.as_ref().map(|id| id.as_bytes().as_slice()))
    .bind(new.request_id.as_ref().map(|id| id.as_bytes().as_slice()))
    .bind(new.fingerprint.as_slice())
    .bind(new.max_attempts)
    .bind(now)
    .bind(&new.project)
    .bind(new.priority)
    .bind(new.needs.memory)
    .bind(new.needs.likely_memory)
    .bind(&new.needs.clip)
    .bind(&new.trace_parent)
    .bind(new.asked_id.as_ref().map(|id| id.as_bytes().as_slice()))
    .fetch_one(&mut *db)
    .await?;
    for input in &new.inputs {
        // The same picture may be named twice.
        sqlx::query("INSERT OR IGNORE INTO job_inputs (artifact_id, job_id) VALUES (?1, ?2)")
            .bind(input.as_bytes().as_slice())
            .bind(new.id.as_bytes().as_slice())
            .execute(&mut *db)
            .await?;
    }
    rows::job(&row)
}

/// Sees that all inputs are visible and the project's.
pub(super) async fn inputs_are_there(db: &mut SqliteConnection, project: &str, inputs: &[ArtifactId]) -> Result<()> {
    for input in inputs {
        let visible =
            sqlx::query("SELECT 1 FROM artifacts WHERE id = ?1 AND state = 3 AND secret = 0 AND project = ?2")
                .bind(input.as_bytes().as_slice())
                .bind(project);
        visible
            .fetch_optional(&mut *db)
            .await?
            .ok_or_else(|| LedgerError::no_artifact(*input))?;
    }
    Ok(())
}

pub(super) async fn find_request(db: &mut SqliteConnection, request: Uuid) -> Result<Option<JobRow>> {
    by_request(db, request).await?.as_ref().map(rows::job).transpose()
}

async fn by_request(db: &mut SqliteConnection, request: Uuid) -> Result<Option<SqliteRow>> {
    let query = sqlx::query("SELECT * FROM jobs WHERE request_id = ?1").bind(request.as_bytes().as_slice());
    Ok(query.fetch_optional(db).await?)
}

pub(super) async fn get(db: &mut SqliteConnection, id: JobId) -> Result<Option<JobRow>> {
    let Some(row) = by_id(db, id).await? else {
        return Ok(None);
    };
    let mut job = rows::job(&row)?;
    if job.state == JobState::Queued {
        // One that leaves the queue in between has none any more.
        job.queue_position = sqlx::query_scalar(POSITION)
            .bind(&job.project)
            .bind(job.priority)
            .bind(row.try_get::<i64, _>("queue_time")?)
            .bind(id.as_bytes().as_slice())
            .fetch_one(db)
            .await?;
    }
    Ok(Some(job))
}

/// Must run in a transaction, so that pages of several states fit together.
pub(super) async fn list(
    db: &mut SqliteConnection,
    project: &str,
    states: &[JobState],
    before: Option<(i64, JobId)>,
    limit: u32,
) -> Result<Vec<JobRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let mut jobs = Vec::new();
    if states.is_empty() {
        let all = sqlx::query(PAGE);
        for row in all
            .bind(time)
            .bind(id.as_bytes().as_slice())
            .bind(limit)
            .bind(project)
            .fetch_all(&mut *db)
            .await?
        {
            jobs.push(rows::job(&row)?);
        }
    }
    // State by state, each from its index: a few running jobs are found quickly among many finished ones.
    for (i, state) in states.iter().enumerate() {
        if states[..i].contains(state) {
            continue;
        }
        let one = sqlx::query(PAGE_OF_STATE);
        let one = one
            .bind(time)
            .bind(id.as_bytes().as_slice())
            .bind(limit)
            .bind(project)
            .bind(*state as i64);
        for row in one.fetch_all(&mut *db).await? {
            jobs.push(rows::job(&row)?);
        }
    }
    jobs.sort_by_key(|job| std::cmp::Reverse((job.create_time, job.id)));
    jobs.truncate(usize::try_from(limit).unwrap_or(usize::MAX));
    if jobs.iter().any(|job| job.state == JobState::Queued) {
        let positions = positions(db).await?;
        for job in &mut jobs {
            job.queue_position = positions.get(&job.id).copied();
        }
    }
    Ok(jobs)
}

/// The whole queue, walked once: counting for each job of a page would walk it for each.
async fn positions(db: &mut SqliteConnection) -> Result<HashMap<JobId, i64>> {
    let queue = queue::all(db).await?;
    Ok((0..).zip(queue).map(|(ahead, id)| (id, ahead)).collect())
}

pub(super) async fn cancel(db: &mut SqliteConnection, id: JobId, now: i64) -> Result<JobRow> {
    let row = by_id(db, id).await?.ok_or_else(|| LedgerError::no_job(id))?;
    let job = rows::job(&row)?;
    match transition::cancel(id, &job)? {
        Cancel::End => leave(db, id, Next::Cancelled, now).await,
        Cancel::Asked => Ok(job),
        Cancel::Ask => {
            let asked = sqlx::query(
                "UPDATE jobs SET cancel_requested = 1, update_time = ?2, revision = revision + 1 WHERE id = ?1 RETURNING *",
            );
            rows::job(&asked.bind(id.as_bytes().as_slice()).bind(now).fetch_one(db).await?)
        }
    }
}

pub(super) async fn by_id(db: &mut SqliteConnection, id: JobId) -> Result<Option<SqliteRow>> {
    Ok(sqlx::query("SELECT * FROM jobs WHERE id = ?1")
        .bind(id.as_bytes().as_slice())
        .fetch_optional(db)
        .await?)
}

/// A queued or running job that reads the artifact.
pub(super) async fn user_of(db: &mut SqliteConnection, artifact: ArtifactId) -> Result<Option<JobId>> {
    let user = sqlx::query(
        "SELECT j.id FROM job_inputs i JOIN jobs j ON j.id = i.job_id \
         WHERE i.artifact_id = ?1 AND j.state IN (1, 2) LIMIT 1",
    );
    let row = user.bind(artifact.as_bytes().as_slice()).fetch_optional(db).await?;
    row.map(|row| rows::id(&row, "id")).transpose()
}

pub(super) async fn queue_depth(db: &mut SqliteConnection) -> Result<i64> {
    Ok(sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 1")
        .fetch_one(db)
        .await?)
}
