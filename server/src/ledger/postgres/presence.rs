//! Ends leases that have expired, for all servers, and knows whether any server was there to hear workers.
//!
//! Each server looks after leases every second and leaves the time. One that begins, or that can write again, extends
//! all leases only if nobody did so lately: then workers had nobody to report to. Otherwise a lease that has expired
//! belongs to a worker that is gone, and extending it, at every start of some server, would keep its job from others.
use std::time::Duration;

use sqlx::{Connection, PgConnection, Row};

use super::super::Result;
use super::super::transition::{after_loss, end_of, micros};
use super::super::types::JobId;
use super::transition::leave;
use super::{jobs, rows};

/// A server that has not looked after leases for so long is not there.
const PRESENT: Duration = Duration::from_secs(3);

pub(super) async fn renew(db: &mut PgConnection, lease: Duration, now: i64) -> Result<()> {
    let last: i64 = sqlx::query_scalar("SELECT time FROM presence WHERE id = 1 FOR UPDATE")
        .fetch_one(&mut *db)
        .await?;
    // One that lies in the future was left by a clock that is wrong.
    if now.abs_diff(last) <= micros(PRESENT).unsigned_abs() {
        return Ok(());
    }
    let query = sqlx::query("UPDATE jobs SET lease_expires = $1 WHERE state = 2 AND lease_expires < $1");
    query.bind(end_of(lease, now)).execute(&mut *db).await?;
    here(db, now).await
}

pub(super) async fn reap(db: &mut PgConnection, now: i64) -> Result<Vec<JobId>> {
    // Servers that do this at once come one after the other.
    here(db, now).await?;
    // A job that is locked is being reported on, or ended, at this moment.
    let expired = sqlx::query(
        "SELECT * FROM jobs WHERE state = 2 AND lease_expires <= $1 ORDER BY lease_expires FOR UPDATE SKIP LOCKED",
    );
    let mut reaped = Vec::new();
    for row in expired.bind(now).fetch_all(&mut *db).await? {
        let job = rows::job(&row)?;
        let next = after_loss(&job, row.try_get("worker")?, now);
        leave(db, job.id, next, now).await?;
        reaped.push(job.id);
    }
    Ok(reaped)
}

/// Reads, and asks for the lock of a row, which a database that takes no writes refuses; it waits for nobody, and writes
/// nothing.
pub(super) async fn check(db: &mut PgConnection) -> Result<()> {
    jobs::queue_depth(db).await?;
    let mut trial = db.begin().await?;
    sqlx::query("SELECT 1 FROM presence FOR UPDATE SKIP LOCKED")
        .execute(&mut *trial)
        .await?;
    Ok(trial.rollback().await?)
}

async fn here(db: &mut PgConnection, now: i64) -> Result<()> {
    sqlx::query("UPDATE presence SET time = $1 WHERE id = 1")
        .bind(now)
        .execute(db)
        .await?;
    Ok(())
}

/// Names the lock under which the chain grows; it means nothing else, and is the database's own.
const CHAIN_LOCK: i64 = 0x6775_6172_6473_706c;
/// Of the locks under which projects reserve bytes.
const PROJECT_LOCK: i32 = 0x6775_6172;

/// Waits until nobody else makes the chain longer, in any server, and keeps it so until the transaction ends. What is
/// read from here on is what others committed before.
pub(super) async fn lock_chain(db: &mut PgConnection) -> Result<()> {
    sqlx::query("SELECT pg_advisory_xact_lock($1)")
        .bind(CHAIN_LOCK)
        .execute(db)
        .await?;
    Ok(())
}

/// Waits until nobody else reserves bytes for this project, in any server, and keeps it so until the transaction ends. A
/// lock of two numbers is another one than any of a single number.
pub(super) async fn lock_project(db: &mut PgConnection, project: &str) -> Result<()> {
    sqlx::query("SELECT pg_advisory_xact_lock($1, hashtext($2))")
        .bind(PROJECT_LOCK)
        .bind(project)
        .execute(db)
        .await?;
    Ok(())
}
