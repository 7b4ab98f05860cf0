//! Workers that were seen.
use super::super::Result;
use super::super::workers::{FORGOTTEN, SeenWorker, WorkerPresence, WorkerRow};
use super::{DbConnection, DbLedger, rows};

#[async_trait::async_trait]
impl WorkerPresence for DbLedger {
    async fn note_worker(&self, worker: SeenWorker, now: i64) -> Result<()> {
        self.change(with!([worker] db => note(db, &worker, now))).await
    }

    async fn workers_since(&self, since: i64) -> Result<Vec<SeenWorker>> {
        self.read(with!([] db => since_time(db, since))).await
    }

    async fn workers_and_jobs(&self, since: i64, limit: u32) -> Result<Vec<WorkerRow>> {
        self.read(with!([] db => with_jobs(db, since, limit))).await
    }
}

async fn note(db: &mut DbConnection, worker: &SeenWorker, now: i64) -> Result<()> {
    let note = sqlx::query(concat!(
        "INSERT INTO seen_workers (name, device, memory, clips, time, version) VALUES ($1, $2, $3, $4, $5, $6) \
         ON CONFLICT (name) DO UPDATE SET device = $2, memory = $3, clips = $4, version = $6, time = ",
        greatest!("seen_workers.time", "$5")
    ));
    note.bind(&worker.name)
        .bind(&worker.device)
        .bind(worker.memory)
        .bind(worker.clips.join(" "))
        .bind(now)
        .bind(&worker.version)
        .execute(&mut *db)
        .await?;
    // Others may be at the same rows: whoever comes first forgets them.
    let forget = sqlx::query(concat!(
        "DELETE FROM seen_workers WHERE name IN (SELECT name FROM seen_workers WHERE time < $1 \
         AND name NOT IN (SELECT worker FROM jobs",
        indexed_by!("jobs_leases"),
        " WHERE state = 2 AND worker IS NOT NULL)",
        skip_locked!(),
        ")"
    ));
    forget.bind(now.saturating_sub(FORGOTTEN)).execute(db).await?;
    Ok(())
}

async fn since_time(db: &mut DbConnection, since: i64) -> Result<Vec<SeenWorker>> {
    let query = sqlx::query(concat!(
        "SELECT * FROM seen_workers WHERE time >= $1 OR name IN (SELECT worker FROM jobs",
        indexed_by!("jobs_leases"),
        " WHERE state = 2) ORDER BY name"
    ));
    let seen = query.bind(since).fetch_all(db).await?;
    seen.iter().map(rows::worker).collect()
}

async fn with_jobs(db: &mut DbConnection, since: i64, limit: u32) -> Result<Vec<WorkerRow>> {
    let query = sqlx::query(concat!(
        "SELECT w.*, j.id, j.project, j.attempt, j.start_time, j.lease_expires FROM seen_workers w \
         LEFT JOIN jobs AS j",
        indexed_by!("jobs_leases"),
        " ON j.state = 2 AND j.worker = w.name WHERE w.time >= $1 OR j.id IS NOT NULL \
         ORDER BY w.name, j.start_time, j.id LIMIT $2"
    ));
    let there = query.bind(since).bind(i64::from(limit)).fetch_all(db).await?;
    there.iter().map(rows::worker_with_job).collect()
}
