//! A copy of the file while others write to it, and what it says of artifacts' bytes: for backups.
use std::path::Path;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};

use super::super::Result;
use super::super::types::{ArtifactId, ArtifactRow, ArtifactState};
use super::{artifacts, open, rows};

/// Writes all that is committed now to a new file, as one moment saw it. The file must not be there. Whoever writes is
/// not held up.
pub async fn copy(ledger: &Path, to: &Path) -> Result<()> {
    let mut db = connect(ledger).await?;
    sqlx::query("VACUUM INTO $1")
        .bind(to.to_string_lossy().into_owned())
        .execute(&mut db)
        .await?;
    Ok(db.close().await?)
}

/// Artifacts whose bytes are all there: published ones, and outputs of attempts that are under way.
pub async fn kept(ledger: &Path) -> Result<Vec<ArtifactRow>> {
    let mut db = connect(ledger).await?;
    let rows = sqlx::query("SELECT * FROM artifacts WHERE state IN (2, 3) ORDER BY id")
        .fetch_all(&mut db)
        .await?;
    db.close().await?;
    rows.iter().map(rows::artifact).collect()
}

/// Whether an artifact is deleted.
pub async fn is_deleted(ledger: &Path, id: ArtifactId) -> Result<bool> {
    let mut db = connect(ledger).await?;
    let row = artifacts::get(&mut db, id).await?;
    db.close().await?;
    Ok(row.is_none_or(|row| row.state == ArtifactState::Deleted))
}

/// Has a copy say that these artifacts are deleted, as the original does by now.
pub async fn mark_deleted(copy: &Path, ids: &[ArtifactId]) -> Result<()> {
    let mut db = connect(copy).await?;
    for id in ids {
        sqlx::query("UPDATE artifacts SET state = 4 WHERE id = $1")
            .bind(id)
            .execute(&mut db)
            .await?;
    }
    Ok(db.close().await?)
}

/// Without WAL, whose files would lie beside a copy; a ledger that is in use stays as it is.
async fn connect(path: &Path) -> Result<SqliteConnection> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(false)
        .busy_timeout(open::BUSY);
    Ok(SqliteConnection::connect_with(&options).await?)
}
