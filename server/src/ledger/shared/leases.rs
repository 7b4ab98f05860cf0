//! Jobs as workers see them. Every change under a token locks the job and checks the token in the transaction that
//! changes.
use std::time::Duration;

use sqlx::Row;

use super::super::transition::{Next, after_attempt, after_release, end_of};
use super::super::types::{Completion, Failure, JobId, JobRow, Lease};
use super::super::work::Progress;
use super::super::workers::WorkerCapabilities;
use super::super::{JobQueue, LedgerError, Result, codec, token};
use super::transition::leave;
use super::{DbConnection, DbLedger, DbRow, artifacts, credentials, jobs, keys, presence, queue, rows};

#[async_trait::async_trait]
impl JobQueue for DbLedger {
    async fn claim_for(&self, capabilities: &WorkerCapabilities, lease: Duration, now: i64) -> Result<Option<Lease>> {
        let capabilities = capabilities.clone();
        self.change(with!([capabilities] db => queue::claim(db, &capabilities, lease, now)))
            .await
    }

    async fn leased_job(&self, id: JobId, token: &str) -> Result<JobRow> {
        let token = token::hash(token);
        self.read(with!([token] db => leased(db, id, &token))).await
    }

    async fn report(
        &self,
        id: JobId,
        token: &str,
        progress: Option<Progress>,
        lease: Duration,
        now: i64,
    ) -> Result<bool> {
        let token = token::hash(token);
        self.change(with!([token, progress] db => report(db, id, &token, progress.as_ref(), lease, now)))
            .await
    }

    async fn complete(&self, id: JobId, token: &str, completion: Completion, now: i64) -> Result<JobRow> {
        let token = token::hash(token);
        self.change(with!([token, completion] db => complete(db, id, &token, &completion, now)))
            .await
    }

    async fn fail(
        &self,
        id: JobId,
        token: &str,
        failure: Option<Failure>,
        retryable: bool,
        cancelled: bool,
        now: i64,
    ) -> Result<JobRow> {
        let token = token::hash(token);
        self.change(with!([token, failure] db => fail(db, id, &token, failure, retryable, cancelled, now)))
            .await
    }

    async fn release(&self, id: JobId, token: &str, now: i64) -> Result<JobRow> {
        let token = token::hash(token);
        self.change(with!([token] db => release(db, id, &token, now))).await
    }

    async fn renew_leases(&self, lease: Duration, now: i64) -> Result<()> {
        self.change(with!([] db => presence::renew(db, lease, now))).await
    }

    async fn reap(&self, now: i64) -> Result<Vec<JobId>> {
        self.change(with!([] db => presence::reap(db, now))).await
    }

    async fn queue(&self) -> Result<Vec<JobId>> {
        self.read(with!([] db => queue::all(db))).await
    }

    async fn queue_depth(&self) -> Result<i64> {
        self.read(with!([] db => jobs::queue_depth(db))).await
    }
}

/// The job, if the token with this hash is its lease.
pub(super) async fn leased(db: &mut DbConnection, id: JobId, token: &[u8]) -> Result<JobRow> {
    let query = sqlx::query("SELECT * FROM jobs WHERE id = $1").bind(id);
    holds(query.fetch_optional(db).await?, id, token)
}

/// The same, and the lease stays what it is until the transaction ends.
pub(super) async fn leased_meanwhile(db: &mut DbConnection, id: JobId, token: &[u8]) -> Result<JobRow> {
    let query = sqlx::query(concat!("SELECT * FROM jobs WHERE id = $1", for_share!())).bind(id);
    holds(query.fetch_optional(db).await?, id, token)
}

/// The same, for whoever is going to change the job.
async fn leased_alone(db: &mut DbConnection, id: JobId, token: &[u8]) -> Result<JobRow> {
    holds(jobs::locked(db, id).await?, id, token)
}

fn holds(row: Option<DbRow>, id: JobId, token: &[u8]) -> Result<JobRow> {
    let row = row.ok_or_else(|| LedgerError::no_job(id))?;
    let current: Option<Vec<u8>> = row.try_get("lease_token")?;
    if current.as_deref() == Some(token) {
        rows::job(&row)
    } else {
        Err(LedgerError::LeaseLost(id))
    }
}

pub(super) async fn report(
    db: &mut DbConnection,
    id: JobId,
    token: &[u8],
    progress: Option<&Progress>,
    lease: Duration,
    now: i64,
) -> Result<bool> {
    let job = leased_alone(db, id, token).await?;
    let progress = progress.map(codec::encode_progress);
    let news = progress.is_some() && progress != job.progress.as_ref().map(codec::encode_progress);
    sqlx::query(
        "UPDATE jobs SET lease_expires = $2, progress = CASE WHEN $3 THEN $4 ELSE progress END, \
         update_time = CASE WHEN $3 THEN $5 ELSE update_time END, \
         revision = revision + CASE WHEN $3 THEN 1 ELSE 0 END WHERE id = $1",
    )
    .bind(id)
    .bind(end_of(lease, now))
    .bind(news)
    .bind(progress)
    .bind(now)
    .execute(db)
    .await?;
    Ok(job.cancel_requested)
}

pub(super) async fn complete(
    db: &mut DbConnection,
    id: JobId,
    token: &[u8],
    completion: &Completion,
    now: i64,
) -> Result<JobRow> {
    let Completion {
        result,
        outputs,
        key,
        credentials,
        fingerprint,
    } = completion;
    let row = jobs::locked(db, id).await?;
    if let Some(row) = &row
        && completed(row, token, fingerprint)?
    {
        return rows::job(row);
    }
    if holds(row, id, token)?.kind() != result.kind() {
        return Err(LedgerError::ResultOfAnotherKind(id));
    }
    for output in outputs {
        artifacts::publish(db, *output, id, token, false, now).await?;
    }
    if let Some(new) = credentials {
        credentials::create(db, new, id, now).await?;
    }
    if let Some(key) = key {
        artifacts::publish(db, key.artifact, id, token, true, now).await?;
        keys::create(db, key, id, now).await?;
    }
    sqlx::query("UPDATE jobs SET completed_token = $2, completed_fingerprint = $3 WHERE id = $1")
        .bind(id)
        .bind(token)
        .bind(fingerprint.as_slice())
        .execute(&mut *db)
        .await?;
    leave(db, id, Next::Succeeded(Box::new(result.clone())), now).await
}

/// Whether this attempt completed the job in just this way before.
fn completed(row: &DbRow, token: &[u8], fingerprint: &[u8]) -> Result<bool> {
    let by: Option<Vec<u8>> = row.try_get("completed_token")?;
    let said: Option<Vec<u8>> = row.try_get("completed_fingerprint")?;
    Ok(by.as_deref() == Some(token) && said.as_deref() == Some(fingerprint))
}

pub(super) async fn fail(
    db: &mut DbConnection,
    id: JobId,
    token: &[u8],
    failure: Option<Failure>,
    retryable: bool,
    cancelled: bool,
    now: i64,
) -> Result<JobRow> {
    let job = leased_alone(db, id, token).await?;
    let next = after_attempt(&job, failure, retryable, cancelled, now)?;
    leave(db, id, next, now).await
}

pub(super) async fn release(db: &mut DbConnection, id: JobId, token: &[u8], now: i64) -> Result<JobRow> {
    let job = leased_alone(db, id, token).await?;
    leave(db, id, after_release(&job), now).await
}
