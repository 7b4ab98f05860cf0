//! Artifacts that jobs read: seen to be there when a job is queued, and noted.
use sqlx::SqliteConnection;

use super::super::types::{ArtifactId, JobId};
use super::super::{LedgerError, Result};

/// Sees that all inputs are visible and the project's; they stay so until the transaction ends.
pub(super) async fn hold(db: &mut SqliteConnection, project: &str, inputs: &[ArtifactId]) -> Result<()> {
    for input in inputs {
        let visible =
            sqlx::query("SELECT 1 FROM artifacts WHERE id = $1 AND state = 3 AND secret = 0 AND project = $2")
                .bind(input)
                .bind(project);
        visible
            .fetch_optional(&mut *db)
            .await?
            .ok_or_else(|| LedgerError::no_artifact(*input))?;
    }
    Ok(())
}

/// Notes what a job reads. The same picture may be named twice.
pub(super) async fn insert(db: &mut SqliteConnection, job: JobId, inputs: &[ArtifactId]) -> Result<()> {
    for input in inputs {
        sqlx::query("INSERT OR IGNORE INTO job_inputs (artifact_id, job_id) VALUES ($1, $2)")
            .bind(input)
            .bind(job)
            .execute(&mut *db)
            .await?;
    }
    Ok(())
}
