//! Rows of content credentials.
use sqlx::Row;

use super::super::Result;
use super::super::credentials::{CredentialsLedger, CredentialsOf, CredentialsRow, Mark, NewCredentials};
use super::super::types::JobId;
use super::{DbConnection, DbLedger, DbRow};

/// Credentials that anybody may see: their job is complete, and they were not deleted. `$1` is the project.
macro_rules! there {
    ($which:literal, $limit:literal) => {
        concat!(
            "SELECT c.*, a.path, a.size, a.job_id FROM content_credentials c JOIN artifacts a ON a.id = c.artifact_id \
             WHERE c.project = $1 AND a.state = 3 AND ",
            $which,
            " ORDER BY c.create_time DESC, c.artifact_id DESC LIMIT ",
            $limit
        )
    };
}

/// By what was marked.
pub(super) const BY_ASSET: &str = there!("c.asset_id = $2 AND c.key_id = $3", "$4");
/// By the message.
pub(super) const BY_MESSAGE: &str = there!("c.message = $2 AND c.key_id = $3", "$4");
/// By what names the mark.
pub(super) const BY_BINDING: &str = there!("c.soft_binding = $2", "$3");
/// By the manifest.
pub(super) const BY_MANIFEST: &str = there!("c.manifest = $2", "$3");

#[async_trait::async_trait]
impl CredentialsLedger for DbLedger {
    async fn find_credentials(&self, project: &str, of: &CredentialsOf, limit: u32) -> Result<Vec<CredentialsRow>> {
        let (project, of) = (project.to_owned(), of.clone());
        self.read(with!([project, of] db => find(db, &project, &of, limit)))
            .await
    }
}

async fn find(db: &mut DbConnection, project: &str, of: &CredentialsOf, limit: u32) -> Result<Vec<CredentialsRow>> {
    let query = match of {
        CredentialsOf::Mark(key, Mark::Asset(asset)) => sqlx::query(BY_ASSET).bind(project).bind(asset).bind(key),
        CredentialsOf::Mark(key, Mark::Message(text)) => sqlx::query(BY_MESSAGE).bind(project).bind(text).bind(key),
        CredentialsOf::Binding(value) => sqlx::query(BY_BINDING).bind(project).bind(value),
        CredentialsOf::Manifest(id) => sqlx::query(BY_MANIFEST).bind(project).bind(id),
    };
    let rows = query.bind(i64::from(limit)).fetch_all(db).await?;
    rows.iter().map(row).collect()
}

/// Those of an output that was just published.
pub(super) async fn create(db: &mut DbConnection, new: &NewCredentials, job: JobId, now: i64) -> Result<()> {
    let (asset, message) = match &new.mark {
        Mark::Asset(asset) => (Some(asset), None),
        Mark::Message(text) => (None, Some(text)),
    };
    let insert = sqlx::query(
        "INSERT INTO content_credentials (artifact_id, project, key_id, asset_id, message, manifest, soft_binding, \
         test_certificate, create_time) SELECT $1, project, key_id, $2, $3, $4, $5, $6, $7 FROM jobs WHERE id = $8",
    );
    insert
        .bind(new.artifact)
        .bind(asset)
        .bind(message)
        .bind(&new.manifest)
        .bind(&new.soft_binding)
        .bind(new.test_certificate)
        .bind(now)
        .bind(job)
        .execute(db)
        .await?;
    Ok(())
}

fn row(row: &DbRow) -> Result<CredentialsRow> {
    Ok(CredentialsRow {
        artifact: row.try_get("artifact_id")?,
        path: row.try_get("path")?,
        size: row.try_get("size")?,
        job: row.try_get("job_id")?,
        manifest: row.try_get("manifest")?,
        soft_binding: row.try_get("soft_binding")?,
        test_certificate: row.try_get("test_certificate")?,
    })
}
