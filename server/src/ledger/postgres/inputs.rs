//! Artifacts that jobs read: held when a job is queued, and noted.
use std::collections::HashSet;

use sqlx::PgConnection;

use super::super::types::{ArtifactId, JobId};
use super::super::{LedgerError, Result};

/// Sees that all inputs are visible and the project's, and holds them: they can't be deleted before this
/// job is there to need them.
pub(super) async fn hold(db: &mut PgConnection, project: &str, inputs: &[ArtifactId]) -> Result<()> {
    let held = sqlx::query_scalar(
        "SELECT id FROM artifacts WHERE id = ANY($1) AND project = $2 AND state = 3 AND NOT secret \
         ORDER BY id FOR SHARE",
    );
    let held = held.bind(inputs).bind(project);
    let there: HashSet<ArtifactId> = held.fetch_all(db).await?.into_iter().collect();
    match inputs.iter().find(|input| !there.contains(input)) {
        Some(missing) => Err(LedgerError::no_artifact(*missing)),
        None => Ok(()),
    }
}

/// Notes what a job reads. The same picture may be named twice.
pub(super) async fn insert(db: &mut PgConnection, job: JobId, inputs: &[ArtifactId]) -> Result<()> {
    sqlx::query("INSERT INTO job_inputs (artifact_id, job_id) SELECT unnest($1), $2 ON CONFLICT DO NOTHING")
        .bind(inputs)
        .bind(job)
        .execute(db)
        .await?;
    Ok(())
}
