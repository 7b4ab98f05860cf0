//! Rows of reservations.
use sqlx::Row;

use super::super::types::ArtifactId;
use super::super::{Result, UploadReservation, UploadReservations};
use super::{DbConnection, DbLedger, presence, statistics};

#[async_trait::async_trait]
impl UploadReservations for DbLedger {
    async fn reserve_upload(&self, new: UploadReservation, limit: u64) -> Result<bool> {
        self.change(with!([new] db => reserve(db, &new, limit))).await
    }

    async fn is_reserved(&self, id: ArtifactId) -> Result<bool> {
        self.read(with!([] db => is_there(db, id))).await
    }

    async fn end_with_address(&self, id: ArtifactId) -> Result<()> {
        self.change(with!([] db => end(db, id))).await
    }

    async fn ended_reservations(&self, now: i64, limit: u32) -> Result<Vec<ArtifactId>> {
        self.read(with!([] db => ended(db, now, limit))).await
    }

    async fn release_upload(&self, id: ArtifactId) -> Result<()> {
        self.change(with!([] db => release(db, id))).await
    }
}

async fn reserve(db: &mut DbConnection, new: &UploadReservation, limit: u64) -> Result<bool> {
    presence::lock_project(db, &new.project).await?;
    let used = statistics::usage(db, &new.project).await?.bytes();
    let size = u64::try_from(new.size).unwrap_or_default();
    if used.saturating_add(size) > limit {
        return Ok(false);
    }
    let query = sqlx::query(
        "INSERT INTO upload_reservations (id, project, size, address_end, end_time) VALUES ($1, $2, $3, $4, $5)",
    );
    let query = query.bind(new.id).bind(&new.project).bind(new.size);
    query.bind(new.address_end).bind(new.end_time).execute(db).await?;
    Ok(true)
}

async fn is_there(db: &mut DbConnection, id: ArtifactId) -> Result<bool> {
    let query = sqlx::query("SELECT 1 FROM upload_reservations WHERE id = $1").bind(id);
    Ok(query.fetch_optional(db).await?.is_some())
}

async fn end(db: &mut DbConnection, id: ArtifactId) -> Result<()> {
    let query = "UPDATE upload_reservations SET end_time = address_end WHERE id = $1 AND end_time > address_end";
    sqlx::query(query).bind(id).execute(db).await?;
    Ok(())
}

async fn ended(db: &mut DbConnection, now: i64, limit: u32) -> Result<Vec<ArtifactId>> {
    let query = sqlx::query("SELECT id FROM upload_reservations WHERE end_time <= $1 ORDER BY end_time LIMIT $2");
    let rows = query.bind(now).bind(i64::from(limit)).fetch_all(db).await?;
    rows.iter().map(|row| Ok(row.try_get("id")?)).collect()
}

pub(super) async fn release(db: &mut DbConnection, id: ArtifactId) -> Result<()> {
    let query = sqlx::query("DELETE FROM upload_reservations WHERE id = $1").bind(id);
    query.execute(db).await?;
    Ok(())
}
