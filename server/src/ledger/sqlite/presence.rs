//! Leases that have expired, and what others would be locked out of: nothing here, as there is one writer.
use std::time::Duration;

use sqlx::{Row, SqliteConnection};

use super::super::Result;
use super::super::transition::{after_loss, end_of};
use super::super::types::JobId;
use super::rows;
use super::transition::leave;

pub(super) async fn renew(db: &mut SqliteConnection, lease: Duration, now: i64) -> Result<()> {
    let query = sqlx::query("UPDATE jobs SET lease_expires = $1 WHERE state = 2 AND lease_expires < $1");
    query.bind(end_of(lease, now)).execute(db).await?;
    Ok(())
}

pub(super) async fn reap(db: &mut SqliteConnection, now: i64) -> Result<Vec<JobId>> {
    let expired = sqlx::query("SELECT * FROM jobs WHERE state = 2 AND lease_expires <= $1 ORDER BY lease_expires")
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

/// The chain of commitments grows in one place at a time anyway.
pub(super) async fn lock_chain(_: &mut SqliteConnection) -> Result<()> {
    Ok(())
}

/// So does what a project has.
pub(super) async fn lock_project(_: &mut SqliteConnection, _: &str) -> Result<()> {
    Ok(())
}
