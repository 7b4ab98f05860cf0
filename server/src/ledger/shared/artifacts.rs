//! Rows of artifacts: announced, stored, published, deleted, collected.
//!
//! Whoever locks a job and its artifacts locks the job first.
use sqlx::Row;

use super::super::types::{ArtifactId, ArtifactRow, ArtifactState, JobId, NewArtifact, Origin};
use super::super::{ArtifactLedger, LedgerError, Result, token};
use super::{DbConnection, DbLedger, history, jobs, leases, reservations, rows};

#[async_trait::async_trait]
impl ArtifactLedger for DbLedger {
    async fn create_artifact(&self, new: NewArtifact, now: i64) -> Result<ArtifactRow> {
        self.change(with!([new] db => create(db, &new, now))).await
    }

    async fn artifact_ready(&self, id: ArtifactId, token: Option<&str>, now: i64) -> Result<ArtifactRow> {
        let token = token.map(token::hash);
        self.change(with!([token] db => ready(db, id, token.as_deref(), now)))
            .await
    }

    async fn get_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        self.read(with!([] db => get_visible(db, id))).await
    }

    async fn get_any_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        self.read(with!([] db => get(db, id))).await
    }

    async fn is_being_read(&self, artifact: ArtifactId) -> Result<bool> {
        self.read(with!([] db => is_being_read(db, artifact))).await
    }

    async fn is_original(&self, artifact: ArtifactId) -> Result<bool> {
        self.read(with!([] db => is_original(db, artifact))).await
    }

    async fn delete_artifact(&self, id: ArtifactId, now: i64) -> Result<()> {
        self.change(with!([] db => delete(db, id, now))).await
    }

    async fn abandoned_artifacts(&self, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>> {
        self.change(with!([] db => abandoned(db, older_than, limit))).await
    }

    async fn put_off_artifact(&self, id: ArtifactId, now: i64) -> Result<()> {
        self.change(with!([] db => put_off(db, id, now))).await
    }

    async fn forget_artifact(&self, id: ArtifactId) -> Result<()> {
        self.change(with!([] db => forget(db, id))).await
    }
}

pub(super) async fn create(db: &mut DbConnection, new: &NewArtifact, now: i64) -> Result<ArtifactRow> {
    let (project, job, token) = match &new.origin {
        Origin::Upload { project } => {
            reservations::release(db, new.id).await?;
            (project.clone(), None, None)
        }
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
    db: &mut DbConnection,
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
    let query = sqlx::query(concat!(
        "SELECT * FROM artifacts WHERE id = $1 AND state <> 4",
        for_update!()
    ))
    .bind(id);
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
    if next == ArtifactState::Ready {
        history::uploaded(db, &artifact).await?;
    }
    Ok(ArtifactRow {
        state: next,
        ..artifact
    })
}

/// Makes a stored output of this attempt what it was made for.
pub(super) async fn publish(
    db: &mut DbConnection,
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

pub(super) async fn get(db: &mut DbConnection, id: ArtifactId) -> Result<Option<ArtifactRow>> {
    let query = sqlx::query("SELECT * FROM artifacts WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(rows::artifact).transpose()
}

pub(super) async fn get_visible(db: &mut DbConnection, id: ArtifactId) -> Result<Option<ArtifactRow>> {
    Ok(get(db, id).await?.filter(is_visible))
}

fn is_visible(artifact: &ArtifactRow) -> bool {
    artifact.state == ArtifactState::Ready && !artifact.secret
}

/// Locks before it looks at who needs it: a job that is being made holds its inputs until it is there.
pub(super) async fn delete(db: &mut DbConnection, id: ArtifactId, now: i64) -> Result<()> {
    let query = sqlx::query(concat!("SELECT * FROM artifacts WHERE id = $1", for_update!())).bind(id);
    let found = query.fetch_optional(&mut *db).await?;
    let found = found.as_ref().map(rows::artifact).transpose()?;
    found.filter(is_visible).ok_or_else(|| LedgerError::no_artifact(id))?;
    if let Some(job) = jobs::user_of(db, id).await? {
        return Err(LedgerError::InUse { artifact: id, job });
    }
    set_state(db, id, ArtifactState::Deleted, now).await
}

async fn set_state(db: &mut DbConnection, id: ArtifactId, state: ArtifactState, now: i64) -> Result<()> {
    sqlx::query("UPDATE artifacts SET state = $2, update_time = $3 WHERE id = $1")
        .bind(id)
        .bind(state as i32)
        .bind(now)
        .execute(db)
        .await?;
    Ok(())
}

/// Marks before it returns, so that an upload that becomes ready at this moment is either kept or told so.
pub(super) async fn abandoned(db: &mut DbConnection, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>> {
    sqlx::query(concat!(
        "WITH gone AS MATERIALIZED (\
         SELECT a.id AS gone_id FROM artifacts a LEFT JOIN jobs j ON j.id = a.job_id \
         WHERE a.state IN (1, 2) AND a.create_time < $1 \
         AND (a.job_id IS NULL OR j.lease_token IS DISTINCT FROM a.lease_token) LIMIT $2",
        skip_locked!("a"),
        ") UPDATE artifacts SET state = 4 FROM gone WHERE id = gone_id"
    ))
    .bind(older_than)
    .bind(i64::from(limit))
    .execute(&mut *db)
    .await?;
    let deleted = sqlx::query("SELECT * FROM artifacts WHERE state = 4 ORDER BY update_time, id LIMIT $1");
    let deleted = deleted.bind(i64::from(limit)).fetch_all(db).await?;
    deleted.iter().map(rows::artifact).collect()
}

async fn put_off(db: &mut DbConnection, id: ArtifactId, now: i64) -> Result<()> {
    let query = sqlx::query("UPDATE artifacts SET update_time = $2 WHERE id = $1 AND state = 4");
    query.bind(id).bind(now).execute(db).await?;
    Ok(())
}

pub(super) async fn forget(db: &mut DbConnection, id: ArtifactId) -> Result<()> {
    let query = sqlx::query("DELETE FROM artifacts WHERE id = $1 AND state = 4").bind(id);
    query.execute(db).await?;
    Ok(())
}

async fn is_being_read(db: &mut DbConnection, artifact: ArtifactId) -> Result<bool> {
    let query = sqlx::query(
        "SELECT 1 FROM job_inputs i JOIN jobs j ON j.id = i.job_id WHERE i.artifact_id = $1 AND j.state = 2 LIMIT 1",
    );
    Ok(query.bind(artifact).fetch_optional(db).await?.is_some())
}

async fn is_original(db: &mut DbConnection, artifact: ArtifactId) -> Result<bool> {
    let query = sqlx::query("SELECT 1 FROM assets WHERE artifact_id = $1 LIMIT 1");
    Ok(query.bind(artifact).fetch_optional(db).await?.is_some())
}
