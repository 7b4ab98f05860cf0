//! Jobs as their owners see them: made, looked at, listed, cancelled.
use std::collections::{HashMap, HashSet};

use sqlx::postgres::PgRow;
use sqlx::{Connection, PgConnection, Row};
use uuid::Uuid;

use super::super::transition::{self, Cancel, Next};
use super::super::types::{ArtifactId, JobId, JobRow, JobState, NewJob};
use super::super::{LedgerError, Result, again};
use super::transition::leave;
use super::{queue, rows};

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

/// A page of a project's jobs.
pub(super) const PAGE: &str = "SELECT * FROM jobs WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// A page of those in one state.
pub(super) const PAGE_OF_STATE: &str = "SELECT * FROM jobs \
    WHERE project = $4 AND state = $5 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

pub(super) async fn create(db: &mut PgConnection, new: &NewJob, now: i64) -> Result<JobRow> {
    if let Some(there) = made_before(db, new).await? {
        return Ok(there);
    }
    inputs_are_there(db, &new.project, &new.inputs).await?;
    if let Some(key) = new.key {
        let there = sqlx::query("SELECT 1 FROM keys WHERE id = $1 AND project = $2")
            .bind(key)
            .bind(&new.project);
        there
            .fetch_optional(&mut *db)
            .await?
            .ok_or(LedgerError::NotFound { kind: "key", id: key })?;
    }
    let row = sqlx::query(
        "INSERT INTO jobs (id, display_name, kind, spec, key_id, request_id, fingerprint, state, max_attempts, \
         create_time, update_time, queue_time, project, priority, memory, likely_memory, clip, trace_parent, asked_id) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, 1, $8, $9, $9, $9, $10, $11, $12, $13, $14, $15, $16) ON CONFLICT (request_id) DO NOTHING RETURNING *",
    )
    .bind(new.id)
    .bind(&new.display_name)
    .bind(new.kind as i32)
    .bind(&new.spec)
    .bind(new.key)
    .bind(new.request_id)
    .bind(new.fingerprint.as_slice())
    .bind(new.max_attempts)
    .bind(now)
    .bind(&new.project)
    .bind(new.priority)
    .bind(new.needs.memory)
    .bind(new.needs.likely_memory)
    .bind(&new.needs.clip)
    .bind(&new.trace_parent)
    .bind(new.asked_id)
    .fetch_optional(&mut *db)
    .await?;
    let Some(row) = row else {
        // The same request, at the same time; by now it has been carried out.
        let there = made_before(db, new).await?;
        return there.ok_or_else(|| sqlx::Error::RowNotFound.into());
    };
    // The same picture may be named twice.
    sqlx::query("INSERT INTO job_inputs (artifact_id, job_id) SELECT unnest($1), $2 ON CONFLICT DO NOTHING")
        .bind(&new.inputs)
        .bind(new.id)
        .execute(&mut *db)
        .await?;
    rows::job(&row)
}

async fn made_before(db: &mut PgConnection, new: &NewJob) -> Result<Option<JobRow>> {
    let Some(request) = new.request_id else { return Ok(None) };
    let Some(row) = by_request(db, request).await? else {
        return Ok(None);
    };
    let fingerprint: Vec<u8> = row.try_get("fingerprint")?;
    again::job(request, rows::job(&row)?, &fingerprint, new).map(Some)
}

/// Sees that all inputs are visible and the project's, and holds them: they can't be deleted before this job is there to need them.
pub(super) async fn inputs_are_there(db: &mut PgConnection, project: &str, inputs: &[ArtifactId]) -> Result<()> {
    let held = sqlx::query_scalar(
        "SELECT id FROM artifacts WHERE id = ANY($1) AND project = $2 AND state = 3 AND NOT secret \
         ORDER BY id FOR SHARE",
    );
    let held = held.bind(inputs).bind(project);
    let there: HashSet<ArtifactId> = held.fetch_all(db).await?.into_iter().collect();
    match inputs.iter().find(|input| !there.contains(input)) {
        Some(missing) => Err(LedgerError::no_artifact(*missing)),
        None => Ok(()),
    }
}

pub(super) async fn find_request(db: &mut PgConnection, request: Uuid) -> Result<Option<JobRow>> {
    by_request(db, request).await?.as_ref().map(rows::job).transpose()
}

async fn by_request(db: &mut PgConnection, request: Uuid) -> Result<Option<PgRow>> {
    let query = sqlx::query("SELECT * FROM jobs WHERE request_id = $1").bind(request);
    Ok(query.fetch_optional(db).await?)
}

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

pub(super) async fn list(
    db: &mut PgConnection,
    project: &str,
    states: &[JobState],
    before: Option<(i64, JobId)>,
    limit: u32,
) -> Result<Vec<JobRow>> {
    // One snapshot, so that pages of several states fit together.
    let mut db = db.begin_with("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY").await?;
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let mut jobs = Vec::new();
    if states.is_empty() {
        let all = sqlx::query(PAGE).bind(time).bind(id).bind(i64::from(limit));
        for row in all.bind(project).fetch_all(&mut *db).await? {
            jobs.push(rows::job(&row)?);
        }
    }
    // State by state, each from its index: a few running jobs are found quickly among many finished ones.
    for (i, state) in states.iter().enumerate() {
        if states[..i].contains(state) {
            continue;
        }
        let one = sqlx::query(PAGE_OF_STATE).bind(time).bind(id).bind(i64::from(limit));
        for row in one.bind(project).bind(*state as i32).fetch_all(&mut *db).await? {
            jobs.push(rows::job(&row)?);
        }
    }
    jobs.sort_by_key(|job| std::cmp::Reverse((job.create_time, job.id)));
    jobs.truncate(usize::try_from(limit).unwrap_or(usize::MAX));
    if jobs.iter().any(|job| job.state == JobState::Queued) {
        let positions = positions(&mut db).await?;
        for job in &mut jobs {
            job.queue_position = positions.get(&job.id).copied();
        }
    }
    db.commit().await?;
    Ok(jobs)
}

/// The whole queue, walked once: counting for each job of a page would walk it for each.
async fn positions(db: &mut PgConnection) -> Result<HashMap<JobId, i64>> {
    let queue = queue::all(db).await?;
    Ok((0..).zip(queue).map(|(ahead, id)| (id, ahead)).collect())
}

pub(super) async fn cancel(db: &mut PgConnection, id: JobId, now: i64) -> Result<JobRow> {
    let row = locked(db, id).await?.ok_or_else(|| LedgerError::no_job(id))?;
    let job = rows::job(&row)?;
    match transition::cancel(id, &job)? {
        Cancel::End => leave(db, id, Next::Cancelled, now).await,
        Cancel::Asked => Ok(job),
        Cancel::Ask => {
            let asked = sqlx::query(
                "UPDATE jobs SET cancel_requested = true, update_time = $2, revision = revision + 1 WHERE id = $1 \
                 RETURNING *",
            );
            rows::job(&asked.bind(id).bind(now).fetch_one(db).await?)
        }
    }
}

pub(super) async fn peek(db: &mut PgConnection, id: JobId) -> Result<Option<JobRow>> {
    let row = sqlx::query("SELECT * FROM jobs WHERE id = $1").bind(id);
    row.fetch_optional(db).await?.as_ref().map(rows::job).transpose()
}

/// A job that nobody else changes until the transaction ends.
pub(super) async fn locked(db: &mut PgConnection, id: JobId) -> Result<Option<PgRow>> {
    let query = sqlx::query("SELECT * FROM jobs WHERE id = $1 FOR UPDATE").bind(id);
    Ok(query.fetch_optional(db).await?)
}

/// A queued or running job that reads the artifact.
pub(super) async fn user_of(db: &mut PgConnection, artifact: ArtifactId) -> Result<Option<JobId>> {
    let user = sqlx::query_scalar(
        "SELECT j.id FROM job_inputs i JOIN jobs j ON j.id = i.job_id \
         WHERE i.artifact_id = $1 AND j.state IN (1, 2) LIMIT 1",
    );
    Ok(user.bind(artifact).fetch_optional(db).await?)
}

pub(super) async fn queue_depth(db: &mut PgConnection) -> Result<i64> {
    Ok(sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 1")
        .fetch_one(db)
        .await?)
}
