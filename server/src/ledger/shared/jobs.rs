//! Jobs as their owners see them: made, looked at, listed, cancelled.
use sqlx::{Connection as _, Row};
use uuid::Uuid;

use super::super::transition::{self, Cancel, Next};
use super::super::types::{ArtifactId, FailureReason, JobId, JobRow, JobState, NewJob};
use super::super::{AttemptRow, JobStore, LedgerError, Result, codec, idempotency};
use super::transition::leave;
use super::{DbConnection, DbLedger, DbRow, SNAPSHOT, inputs, queue, retries, rows};

/// A page of a project's jobs.
pub(super) const PAGE: &str = "SELECT * FROM jobs WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// A page of those in one state.
pub(super) const PAGE_OF_STATE: &str = "SELECT * FROM jobs \
    WHERE project = $4 AND state = $5 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

#[async_trait::async_trait]
impl JobStore for DbLedger {
    async fn create_job(&self, new: NewJob, now: i64) -> Result<JobRow> {
        let made = self.change(with!([new] db => create(db, &new, now)));
        let job = made.await?;
        // The position is counted afterwards: the rows are locked no longer than need be.
        Ok(self.get_job(job.id).await?.unwrap_or(job))
    }

    async fn find_request(&self, request: Uuid) -> Result<Option<JobRow>> {
        self.read(with!([] db => find_request(db, request))).await
    }

    async fn get_job(&self, id: JobId) -> Result<Option<JobRow>> {
        self.read(with!([] db => queue::get(db, id))).await
    }

    async fn peek_job(&self, id: JobId) -> Result<Option<JobRow>> {
        self.read(with!([] db => peek(db, id))).await
    }

    async fn list_jobs(
        &self,
        project: &str,
        states: &[JobState],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>> {
        let (project, states) = (project.to_owned(), states.to_vec());
        self.read(with!([project, states] db => list(db, &project, &states, before, limit)))
            .await
    }

    async fn list_failed(
        &self,
        project: &str,
        reasons: &[FailureReason],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>> {
        let (project, reasons) = (project.to_owned(), reasons.to_vec());
        self.read(with!([project, reasons] db => retries::list_failed(db, &project, &reasons, before, limit)))
            .await
    }

    async fn attempts(&self, job: JobId) -> Result<Vec<AttemptRow>> {
        self.read(with!([] db => retries::attempts(db, job))).await
    }

    async fn cancel_job(&self, id: JobId, now: i64) -> Result<JobRow> {
        self.change(with!([] db => cancel(db, id, now))).await
    }

    async fn requeue(&self, job: JobId, inputs: &[ArtifactId], now: i64) -> Result<JobRow> {
        let inputs = inputs.to_vec();
        self.change(with!([inputs] db => retries::requeue(db, job, &inputs, now)))
            .await
    }
}

pub(super) async fn create(db: &mut DbConnection, new: &NewJob, now: i64) -> Result<JobRow> {
    if let Some(there) = find_repeated(db, new).await? {
        return Ok(there);
    }
    inputs::hold(db, &new.project, &new.inputs).await?;
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
    .bind(new.spec.kind() as i32)
    .bind(codec::encode_spec(&new.spec))
    .bind(new.key)
    .bind(new.request_id)
    .bind(new.fingerprint.as_slice())
    .bind(new.max_attempts)
    .bind(now)
    .bind(&new.project)
    .bind(new.priority)
    .bind(new.requirements.memory)
    .bind(new.requirements.likely_memory)
    .bind(&new.requirements.clip)
    .bind(&new.trace_parent)
    .bind(new.asked_id)
    .fetch_optional(&mut *db)
    .await?;
    let Some(row) = row else {
        // The same request, at the same time; by now it has been carried out.
        let there = find_repeated(db, new).await?;
        return there.ok_or_else(|| sqlx::Error::RowNotFound.into());
    };
    inputs::insert(db, new.id, &new.inputs).await?;
    rows::job(&row)
}

async fn find_repeated(db: &mut DbConnection, new: &NewJob) -> Result<Option<JobRow>> {
    let Some(request) = new.request_id else { return Ok(None) };
    let Some(row) = by_request(db, request).await? else {
        return Ok(None);
    };
    let fingerprint: Vec<u8> = row.try_get("fingerprint")?;
    idempotency::job(request, rows::job(&row)?, &fingerprint, new).map(Some)
}

pub(super) async fn find_request(db: &mut DbConnection, request: Uuid) -> Result<Option<JobRow>> {
    by_request(db, request).await?.as_ref().map(rows::job).transpose()
}

async fn by_request(db: &mut DbConnection, request: Uuid) -> Result<Option<DbRow>> {
    let query = sqlx::query("SELECT * FROM jobs WHERE request_id = $1").bind(request);
    Ok(query.fetch_optional(db).await?)
}

pub(super) async fn list(
    db: &mut DbConnection,
    project: &str,
    states: &[JobState],
    before: Option<(i64, JobId)>,
    limit: u32,
) -> Result<Vec<JobRow>> {
    // One snapshot, so that pages of several states fit together.
    let mut db = db.begin_with(SNAPSHOT).await?;
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
    db.commit().await?;
    Ok(jobs)
}

pub(super) async fn cancel(db: &mut DbConnection, id: JobId, now: i64) -> Result<JobRow> {
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

pub(super) async fn peek(db: &mut DbConnection, id: JobId) -> Result<Option<JobRow>> {
    let row = sqlx::query("SELECT * FROM jobs WHERE id = $1").bind(id);
    row.fetch_optional(db).await?.as_ref().map(rows::job).transpose()
}

/// A job that nobody else changes until the transaction ends.
pub(super) async fn locked(db: &mut DbConnection, id: JobId) -> Result<Option<DbRow>> {
    let query = sqlx::query(concat!("SELECT * FROM jobs WHERE id = $1", for_update!())).bind(id);
    Ok(query.fetch_optional(db).await?)
}

/// A queued or running job that reads the artifact.
pub(super) async fn user_of(db: &mut DbConnection, artifact: ArtifactId) -> Result<Option<JobId>> {
    let user = sqlx::query_scalar(
        "SELECT j.id FROM job_inputs i JOIN jobs j ON j.id = i.job_id \
         WHERE i.artifact_id = $1 AND j.state IN (1, 2) LIMIT 1",
    );
    Ok(user.bind(artifact).fetch_optional(db).await?)
}

pub(super) async fn queue_depth(db: &mut DbConnection) -> Result<i64> {
    Ok(sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 1")
        .fetch_one(db)
        .await?)
}
