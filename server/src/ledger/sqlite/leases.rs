//! Jobs as workers see them. Every change under a token checks the token in the transaction that changes.
use std::time::Duration;

use sqlx::{Row, SqliteConnection};

use super::super::transition::{Next, after_attempt, after_loss, after_release, end_of};
use super::super::types::{Completion, Failure, JobId, JobRow};
use super::super::{LedgerError, Result};
use super::transition::leave;
use super::{artifacts, jobs, keys, rows};

/// The job, if the token with this hash is its lease.
pub(super) async fn leased(db: &mut SqliteConnection, id: JobId, token: &[u8]) -> Result<JobRow> {
    let row = jobs::by_id(db, id).await?.ok_or_else(|| LedgerError::no_job(id))?;
    let current: Option<Vec<u8>> = row.try_get("lease_token")?;
    if current.as_deref() == Some(token) {
        rows::job(&row)
    } else {
        Err(LedgerError::LeaseLost(id))
    }
}

pub(super) async fn report(
    db: &mut SqliteConnection,
    id: JobId,
    token: Vec<u8>,
    progress: Option<Vec<u8>>,
    lease: Duration,
    now: i64,
) -> Result<bool> {
    let job = leased(db, id, &token).await?;
    let news = progress.is_some() && progress != job.progress;
    sqlx::query(
        "UPDATE jobs SET lease_expires = ?2, progress = iif(?3, ?4, progress), update_time = iif(?3, ?5, update_time), \
         revision = revision + iif(?3, 1, 0) WHERE id = ?1",
    )
    .bind(id.as_bytes().as_slice())
    .bind(end_of(lease, now))
    .bind(news)
    .bind(progress)
    .bind(now)
    .execute(db)
    .await?;
    Ok(job.cancel_requested)
}

pub(super) async fn complete(
    db: &mut SqliteConnection,
    id: JobId,
    token: Vec<u8>,
    completion: Completion,
    now: i64,
) -> Result<JobRow> {
    if let Some(job) = completed(db, id, &token, &completion.fingerprint).await? {
        return Ok(job);
    }
    leased(db, id, &token).await?;
    let Completion {
        result,
        outputs,
        key,
        fingerprint,
    } = completion;
    for output in outputs {
        artifacts::publish(db, output, id, &token, false, now).await?;
    }
    if let Some(key) = key {
        artifacts::publish(db, key.artifact, id, &token, true, now).await?;
        keys::create(db, key, id, now).await?;
    }
    sqlx::query("UPDATE jobs SET completed_token = ?2, completed_fingerprint = ?3 WHERE id = ?1")
        .bind(id.as_bytes().as_slice())
        .bind(&token)
        .bind(fingerprint.as_slice())
        .execute(&mut *db)
        .await?;
    leave(db, id, Next::Succeeded(result), now).await
}

/// The job, if this attempt completed it in just this way before.
async fn completed(db: &mut SqliteConnection, id: JobId, token: &[u8], fingerprint: &[u8]) -> Result<Option<JobRow>> {
    let query = sqlx::query("SELECT * FROM jobs WHERE id = ?1 AND completed_token = ?2 AND completed_fingerprint = ?3");
    let found = query.bind(id.as_bytes().as_slice()).bind(token).bind(fingerprint);
    found.fetch_optional(db).await?.as_ref().map(rows::job).transpose()
}

pub(super) async fn fail(
    db: &mut SqliteConnection,
    id: JobId,
    token: Vec<u8>,
    failure: Option<Failure>,
    retryable: bool,
    cancelled: bool,
    now: i64,
) -> Result<JobRow> {
    let job = leased(db, id, &token).await?;
    let next = after_attempt(&job, failure, retryable, cancelled, now)?;
    leave(db, id, next, now).await
}

pub(super) async fn release(db: &mut SqliteConnection, id: JobId, token: Vec<u8>, now: i64) -> Result<JobRow> {
    let job = leased(db, id, &token).await?;
    leave(db, id, after_release(&job), now).await
}

pub(super) async fn renew(db: &mut SqliteConnection, lease: Duration, now: i64) -> Result<()> {
    let query = sqlx::query("UPDATE jobs SET lease_expires = ?1 WHERE state = 2 AND lease_expires < ?1");
    query.bind(end_of(lease, now)).execute(db).await?;
    Ok(())
}

pub(super) async fn reap(db: &mut SqliteConnection, now: i64) -> Result<Vec<JobId>> {
    let expired = sqlx::query("SELECT * FROM jobs WHERE state = 2 AND lease_expires <= ?1 ORDER BY lease_expires")
        .bind(now)
        .fetch_all(&mut *db)
        .await?;
    let mut reaped = Vec::with_capacity(expired.len());
    for row in expired {
        let job = rows::job(&row)?;
        let worker: Option<String> = row.try_get("worker")?;
        let next = after_loss(&job, worker, now);
        leave(db, job.id, next, now).await?;
        reaped.push(job.id);
    }
    Ok(reaped)
}
