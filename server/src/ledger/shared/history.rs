//! Rows of files that were seen, and of their readings.
use sqlx::Row;

use super::super::history::{Before, NewReading, ReadingHistory};
use super::super::types::ArtifactRow;
use super::super::{LedgerError, Result};
use super::{DbConnection, DbLedger};

/// Readings of any file of a reading, by whoever had that one made.
pub(super) const READINGS: &str = "SELECT count(DISTINCT o.reading_id) FROM read_files m \
    JOIN read_files o ON o.project = m.project AND o.sha256 = m.sha256 WHERE m.reading_id = $1";
/// When any of its files came first.
pub(super) const FIRST_SEEN: &str = "SELECT min(s.time) FROM read_files m \
    JOIN seen_files s ON s.project = m.project AND s.sha256 = m.sha256 WHERE m.reading_id = $1";
/// Readings with its key.
pub(super) const OF_KEY: &str =
    "SELECT count(*) FROM readings WHERE key_id = (SELECT key_id FROM readings WHERE id = $1)";

#[async_trait::async_trait]
impl ReadingHistory for DbLedger {
    async fn note_reading(&self, new: NewReading, now: i64) -> Result<()> {
        self.change(with!([new] db => note(db, &new, now))).await
    }

    async fn before(&self, reading: [u8; 32]) -> Result<Option<Before>> {
        self.read(with!([] db => before(db, reading))).await
    }
}

async fn note(db: &mut DbConnection, new: &NewReading, now: i64) -> Result<()> {
    let insert = sqlx::query(
        "INSERT INTO readings (id, project, key_id, time) VALUES ($1, $2, $3, $4) ON CONFLICT (id) DO NOTHING",
    );
    let insert = insert.bind(new.id.as_slice()).bind(&new.project).bind(new.key);
    insert.bind(now).execute(&mut *db).await?;
    // In one order, so that two readings of the same files do not wait for each other.
    let mut files = new.files.clone();
    files.sort();
    files.dedup_by(|later, first| later.0 == first.0);
    for (sha256, time) in &files {
        seen(db, &new.project, sha256, *time).await?;
        let insert = sqlx::query(
            "INSERT INTO read_files (project, sha256, reading_id) VALUES ($1, $2, $3) ON CONFLICT DO NOTHING",
        );
        let insert = insert.bind(&new.project).bind(sha256).bind(new.id.as_slice());
        insert.execute(&mut *db).await?;
    }
    Ok(())
}

/// An upload is all there.
pub(super) async fn uploaded(db: &mut DbConnection, artifact: &ArtifactRow) -> Result<()> {
    seen(db, &artifact.project, &artifact.sha256, artifact.create_time).await
}

async fn seen(db: &mut DbConnection, project: &str, sha256: &str, time: i64) -> Result<()> {
    let insert = sqlx::query(
        "INSERT INTO seen_files (project, sha256, time) VALUES ($1, $2, $3) \
         ON CONFLICT (project, sha256) DO UPDATE SET time = excluded.time WHERE excluded.time < seen_files.time",
    );
    insert.bind(project).bind(sha256).bind(time).execute(db).await?;
    Ok(())
}

async fn before(db: &mut DbConnection, reading: [u8; 32]) -> Result<Option<Before>> {
    let reading = reading.as_slice();
    let first_seen: Option<i64> = sqlx::query(FIRST_SEEN)
        .bind(reading)
        .fetch_one(&mut *db)
        .await?
        .try_get(0)?;
    let Some(first_seen) = first_seen else { return Ok(None) };
    let readings: i64 = sqlx::query_scalar(READINGS).bind(reading).fetch_one(&mut *db).await?;
    let of_key: i64 = sqlx::query_scalar(OF_KEY).bind(reading).fetch_one(&mut *db).await?;
    Ok(Some(Before {
        first_seen,
        readings: count(readings)?,
        readings_of_key: count(of_key)?,
    }))
}

pub(super) fn count(value: i64) -> Result<u64> {
    u64::try_from(value).map_err(|_| LedgerError::Corrupt {
        what: "count of rows",
        value,
    })
}
