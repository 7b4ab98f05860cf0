//! How much there is to do, and how much a project takes.
use sqlx::{Connection as _, Row};

use super::super::statistics::{Running, Statistics, Tally, Usage, Waiting, count};
use super::super::{FailureReason, LedgerError, Result, discriminants};
use super::{DbConnection, DbLedger, SNAPSHOT, rows};

/// Queued jobs by kind.
pub(super) const QUEUED: &str = concat!(
    "SELECT kind, count(*) AS count, min(queue_time) AS since FROM jobs",
    indexed_by!("jobs_queue"),
    " WHERE state = 1 GROUP BY kind"
);

/// Running jobs by kind.
pub(super) const RUNNING: &str = concat!(
    "SELECT kind, count(*) AS count, ",
    total!("coalesce(likely_memory, memory)"),
    " AS memory FROM jobs",
    indexed_by!("jobs_leases"),
    " WHERE state = 2 GROUP BY kind"
);

/// Failed jobs by kind and reason.
pub(super) const FAILED: &str = concat!(
    "SELECT kind, coalesce(failure_reason, 0) AS reason, count(*) AS count FROM jobs",
    indexed_by!("jobs_failed"),
    " WHERE state = 4 GROUP BY kind, failure_reason"
);

/// What a project takes; all from indexes alone. PostgreSQL's sum of bigints is of another type.
pub(super) const USAGE: &str = "SELECT \
    (SELECT count(*) FROM jobs WHERE project = $1 AND state = 1) AS queued_jobs, \
    (SELECT CAST(coalesce(sum(size), 0) AS bigint) FROM artifacts WHERE project = $1 AND state IN (2, 3)) AS artifact_bytes, \
    (SELECT CAST(coalesce(sum(size), 0) AS bigint) FROM upload_reservations WHERE project = $1) AS reserved_bytes";

#[async_trait::async_trait]
impl Statistics for DbLedger {
    async fn tally(&self) -> Result<Tally> {
        self.read(with!([] db => tally(db))).await
    }

    async fn usage(&self, project: &str) -> Result<Usage> {
        let project = project.to_owned();
        self.read(with!([project] db => usage(db, &project))).await
    }
}

async fn tally(db: &mut DbConnection) -> Result<Tally> {
    // One snapshot, so that no job is counted twice, or not at all.
    let mut db = db.begin_with(SNAPSHOT).await?;
    let mut tally = Tally::default();
    for row in sqlx::query(QUEUED).fetch_all(&mut *db).await? {
        tally.queued.push(Waiting {
            kind: discriminants::job_kind(rows::number(&row, "kind")?)?,
            count: count(row.try_get("count")?),
            since: row.try_get("since")?,
        });
    }
    for row in sqlx::query(RUNNING).fetch_all(&mut *db).await? {
        tally.running.push(Running {
            kind: discriminants::job_kind(rows::number(&row, "kind")?)?,
            count: count(row.try_get("count")?),
            memory: count(row.try_get("memory")?),
        });
    }
    for row in sqlx::query(FAILED).fetch_all(&mut *db).await? {
        let kind = discriminants::job_kind(rows::number(&row, "kind")?)?;
        let reason = FailureReason::from_number(row.try_get("reason")?);
        tally.failed.push((kind, reason, count(row.try_get("count")?)));
    }
    db.commit().await?;
    Ok(tally)
}

pub(super) async fn usage(db: &mut DbConnection, project: &str) -> Result<Usage> {
    let row = sqlx::query(USAGE).bind(project).fetch_one(db).await?;
    let number = |column| Ok::<_, LedgerError>(u64::try_from(row.try_get::<i64, _>(column)?).unwrap_or_default());
    Ok(Usage {
        queued_jobs: number("queued_jobs")?,
        artifact_bytes: number("artifact_bytes")?,
        reserved_bytes: number("reserved_bytes")?,
    })
}
