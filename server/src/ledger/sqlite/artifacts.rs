//! Rows of artifacts: announced, stored, published, deleted, collected.
use sqlx::{Row, SqliteConnection};

use super::super::types::{ArtifactId, ArtifactRow, ArtifactState, JobId, NewArtifact, Origin};
use super::super::{LedgerError, Result, token};
use super::{jobs, leases, rows};

pub(super) async fn create(db: &mut SqliteConnection, new: NewArtifact, now: i64) -> Result<ArtifactRow> {
    let (project, job, token) = match new.origin {
        Origin::Upload { project } => (project, None, None),
        Origin::Output { job, token } => {
            let token = token::hash(&token);
            let leased = leases::leased(db, job, &token).await?;
            (leased.project, Some(job), Some(token))
        }
    };
    let row = sqlx::query(
        "INSERT INTO artifacts (id, display_name, size, sha256, job_id, lease_token, secret, path, state, create_time, \
         update_time, project, evidence) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, 1, ?9, ?9, ?10, ?11) RETURNING *",
    )
    .bind(new.id.as_bytes().as_slice())
    .bind(&new.display_name)
    .bind(new.size)
    .bind(&new.sha256)
    .bind(job.as_ref().map(|id| id.as_bytes().as_slice()))
    .bind(token)
    .bind(new.secret)
    .bind(&new.path)
    .bind(now)
    .bind(project)
    .bind(new.evidence)
    .fetch_one(db)
    .await?;
    rows::artifact(&row)
}

pub(super) async fn ready(
    db: &mut SqliteConnection,
    id: ArtifactId,
    token: Option<Vec<u8>>,
    now: i64,
) -> Result<ArtifactRow> {
    let query = sqlx::query("SELECT * FROM artifacts WHERE id = ?1 AND state <> 4").bind(id.as_bytes().as_slice());
    let row = query
        .fetch_optional(&mut *db)
        .await?
        .ok_or_else(|| LedgerError::no_artifact(id))?;
    let artifact = rows::artifact(&row)?;
    let next = match (artifact.job, token) {
        (None, None) => ArtifactState::Ready,
        // Not this attempt's, whoever asks.
        (None, Some(_)) => return Err(LedgerError::NotAnOutput(id)),
        (Some(job), None) => return Err(LedgerError::LeaseLost(job)),
        (Some(job), Some(token)) => {
            leases::leased(db, job, &token).await?;
            let written_under: Option<Vec<u8>> = row.try_get("lease_token")?;
            if written_under != Some(token) {
                return Err(LedgerError::NotAnOutput(id));
            }
            ArtifactState::Stored
        }
    };
    if artifact.state != ArtifactState::Pending {
        return Ok(artifact);
    }
    set_state(db, id, next, now).await?;
    Ok(ArtifactRow {
        state: next,
        ..artifact
    })
}

/// Makes a stored output of this attempt what it was made for.
pub(super) async fn publish(
    db: &mut SqliteConnection,
    id: ArtifactId,
    job: JobId,
    token: &[u8],
    secret: bool,
    now: i64,
) -> Result<()> {
    let published = sqlx::query(
        "UPDATE artifacts SET state = 3, update_time = ?5 \
         WHERE id = ?1 AND job_id = ?2 AND lease_token = ?3 AND secret = ?4 AND state = 2",
    )
    .bind(id.as_bytes().as_slice())
    .bind(job.as_bytes().as_slice())
    .bind(token)
    .bind(secret)
    .bind(now)
    .execute(db)
    .await?;
    if published.rows_affected() == 1 {
        Ok(())
    } else {
        Err(LedgerError::NotAnOutput(id))
    }
}

pub(super) async fn get(db: &mut SqliteConnection, id: ArtifactId) -> Result<Option<ArtifactRow>> {
    let query = sqlx::query("SELECT * FROM artifacts WHERE id = ?1").bind(id.as_bytes().as_slice());
    query.fetch_optional(db).await?.as_ref().map(rows::artifact).transpose()
}

pub(super) async fn get_visible(db: &mut SqliteConnection, id: ArtifactId) -> Result<Option<ArtifactRow>> {
    let found = get(db, id).await?;
    Ok(found.filter(|artifact| artifact.state == ArtifactState::Ready && !artifact.secret))
}

pub(super) async fn delete(db: &mut SqliteConnection, id: ArtifactId, now: i64) -> Result<()> {
    get_visible(db, id).await?.ok_or_else(|| LedgerError::no_artifact(id))?;
    if let Some(job) = jobs::user_of(db, id).await? {
        return Err(LedgerError::InUse { artifact: id, job });
    }
    set_state(db, id, ArtifactState::Deleted, now).await
}

async fn set_state(db: &mut SqliteConnection, id: ArtifactId, state: ArtifactState, now: i64) -> Result<()> {
    sqlx::query("UPDATE artifacts SET state = ?2, update_time = ?3 WHERE id = ?1")
        .bind(id.as_bytes().as_slice())
        .bind(state as i64)
        .bind(now)
        .execute(db)
        .await?;
    Ok(())
}

/// Marks before it returns, so that an upload that becomes ready at this moment is either kept or told so.
pub(super) async fn abandoned(db: &mut SqliteConnection, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>> {
    sqlx::query(
        "UPDATE artifacts SET state = 4 WHERE id IN (\
         SELECT a.id FROM artifacts a LEFT JOIN jobs j ON j.id = a.job_id \
         WHERE a.state IN (1, 2) AND a.create_time < ?1 AND (a.job_id IS NULL OR j.lease_token IS NOT a.lease_token) \
         LIMIT ?2)",
    )
    .bind(older_than)
    .bind(limit)
    .execute(&mut *db)
    .await?;
    let deleted = sqlx::query("SELECT * FROM artifacts WHERE state = 4 ORDER BY create_time LIMIT ?1").bind(limit);
    deleted.fetch_all(db).await?.iter().map(rows::artifact).collect()
}

pub(super) async fn forget(db: &mut SqliteConnection, id: ArtifactId) -> Result<()> {
    let query = sqlx::query("DELETE FROM artifacts WHERE id = ?1 AND state = 4").bind(id.as_bytes().as_slice());
    query.execute(db).await?;
    Ok(())
}
