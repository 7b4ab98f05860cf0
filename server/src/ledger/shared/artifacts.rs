//! Rows of artifacts: announced, stored, published, deleted, collected.
//!
//! Whoever locks a job and its artifacts locks the job first.
use sqlx::{PgConnection, Row};

use super::super::types::{ArtifactId, ArtifactRow, ArtifactState, JobId, NewArtifact, Origin};
use super::super::{LedgerError, Result, token};
use super::{jobs, leases, rows};

pub(super) async fn create(db: &mut PgConnection, new: &NewArtifact, now: i64) -> Result<ArtifactRow> {
    let (project, job, token) = match &new.origin {
        Origin::Upload { project } => (project.clone(), None, None),
        Origin::Output { job, token } => {
            let token = token::hash(token);
            let leased = leases::leased_meanwhile(db, *job, &token).await?;
            (leased.project, Some(*job), Some(token))
        }
    };
    let row = sqlx::query(
        "INSERT INTO artifacts (id, display_name, size, sha256, job_id, lease_token, secret, path, state, create_time, \
         update_time, project, evidence) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, 1, $9, $9, $10, $11) RETURNING *",
    )
    .bind(new.id)
    .bind(&new.display_name)
    .bind(new.size)
    .bind(&new.sha256)
    .bind(job)
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
    db: &mut PgConnection,
    id: ArtifactId,
    token: Option<&[u8]>,
    now: i64,
) -> Result<ArtifactRow> {
    // Whose it is never changes, so it may be read before anything is locked.
    let missing = || LedgerError::no_artifact(id);
    let job = get(db, id).await?.ok_or_else(missing)?.job;
    let leased = match (job, token) {
        (Some(job), Some(token)) => Some(leases::leased_meanwhile(db, job, token).await),
        _ => None,
    };
    let query = sqlx::query("SELECT * FROM artifacts WHERE id = $1 AND state <> 4 FOR UPDATE").bind(id);
    let row = query.fetch_optional(&mut *db).await?.ok_or_else(missing)?;
    let artifact = rows::artifact(&row)?;
    let next = match (artifact.job, token) {
        (None, None) => ArtifactState::Ready,
        // Not this attempt's, whoever asks.
        (None, Some(_)) => return Err(LedgerError::NotAnOutput(id)),
        (Some(job), None) => return Err(LedgerError::LeaseLost(job)),
        (Some(_), Some(token)) => {
            leased.transpose()?;
            let written_under: Option<Vec<u8>> = row.try_get("lease_token")?;
            if written_under.as_deref() != Some(token) {
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
    db: &mut PgConnection,
    id: ArtifactId,
    job: JobId,
    token: &[u8],
    secret: bool,
    now: i64,
) -> Result<()> {
    let published = sqlx::query(
        "UPDATE artifacts SET state = 3, update_time = $5 \
         WHERE id = $1 AND job_id = $2 AND lease_token = $3 AND secret = $4 AND state = 2",
    )
    .bind(id)
    .bind(job)
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

pub(super) async fn get(db: &mut PgConnection, id: ArtifactId) -> Result<Option<ArtifactRow>> {
    let query = sqlx::query("SELECT * FROM artifacts WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(rows::artifact).transpose()
}

pub(super) async fn get_visible(db: &mut PgConnection, id: ArtifactId) -> Result<Option<ArtifactRow>> {
    Ok(get(db, id).await?.filter(is_visible))
}

fn is_visible(artifact: &ArtifactRow) -> bool {
    artifact.state == ArtifactState::Ready && !artifact.secret
}

/// Locks before it looks at who needs it: a job that is being made holds its inputs until it is there.
pub(super) async fn delete(db: &mut PgConnection, id: ArtifactId, now: i64) -> Result<()> {
    let query = sqlx::query("SELECT * FROM artifacts WHERE id = $1 FOR UPDATE").bind(id);
    let found = query.fetch_optional(&mut *db).await?;
    let found = found.as_ref().map(rows::artifact).transpose()?;
    found.filter(is_visible).ok_or_else(|| LedgerError::no_artifact(id))?;
    if let Some(job) = jobs::user_of(db, id).await? {
        return Err(LedgerError::InUse { artifact: id, job });
    }
    set_state(db, id, ArtifactState::Deleted, now).await
}

async fn set_state(db: &mut PgConnection, id: ArtifactId, state: ArtifactState, now: i64) -> Result<()> {
    sqlx::query("UPDATE artifacts SET state = $2, update_time = $3 WHERE id = $1")
        .bind(id)
        .bind(state as i32)
        .bind(now)
        .execute(db)
        .await?;
    Ok(())
}

/// Marks before it returns, so that an upload that becomes ready at this moment is either kept or told so.
pub(super) async fn abandoned(db: &mut PgConnection, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>> {
    sqlx::query(
        "WITH gone AS MATERIALIZED (\
         SELECT a.id AS gone_id FROM artifacts a LEFT JOIN jobs j ON j.id = a.job_id \
         WHERE a.state IN (1, 2) AND a.create_time < $1 \
         AND (a.job_id IS NULL OR j.lease_token IS DISTINCT FROM a.lease_token) \
         LIMIT $2 FOR UPDATE OF a SKIP LOCKED) \
         UPDATE artifacts SET state = 4 FROM gone WHERE id = gone_id",
    )
    .bind(older_than)
    .bind(i64::from(limit))
    .execute(&mut *db)
    .await?;
    let deleted = sqlx::query("SELECT * FROM artifacts WHERE state = 4 ORDER BY create_time LIMIT $1");
    let deleted = deleted.bind(i64::from(limit)).fetch_all(db).await?;
    deleted.iter().map(rows::artifact).collect()
}

pub(super) async fn forget(db: &mut PgConnection, id: ArtifactId) -> Result<()> {
    let query = sqlx::query("DELETE FROM artifacts WHERE id = $1 AND state = 4").bind(id);
    query.execute(db).await?;
    Ok(())
}
