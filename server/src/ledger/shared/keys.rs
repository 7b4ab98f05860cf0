//! Rows of keys.
use sqlx::Row;
use uuid::Uuid;

use super::super::registry::KeyState;
use super::super::types::{JobId, JobKind, KeyId, KeyRow, NewKey};
use super::super::work::{JobSpec, KeyOrder, Seed};
use super::super::{KeyLedger, LedgerError, Result, codec};
use super::{DbConnection, DbLedger, rows};

/// A page of a project's keys.
pub(super) const PAGE: &str = "SELECT * FROM keys WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

#[async_trait::async_trait]
impl KeyLedger for DbLedger {
    async fn get_key(&self, id: KeyId) -> Result<Option<KeyRow>> {
        self.read(with!([] db => get(db, id))).await
    }

    async fn list_keys(&self, project: &str, before: Option<(i64, KeyId)>, limit: u32) -> Result<Vec<KeyRow>> {
        let project = project.to_owned();
        self.read(with!([project] db => list(db, &project, before, limit)))
            .await
    }

    async fn update_key_state(&self, id: KeyId, next: KeyState, reason: &str, now: i64) -> Result<KeyRow> {
        let reason = reason.to_owned();
        self.change(with!([reason] db => update_state(db, id, next, &reason, now)))
            .await
    }

    async fn open_seeds(&self) -> Result<Vec<(JobId, KeyOrder)>> {
        self.read(with!([] db => open_seeds(db))).await
    }

    async fn seal_seed(&self, job: JobId, order: KeyOrder, fingerprint: [u8; 32]) -> Result<()> {
        self.change(with!([order] db => seal_seed(db, job, &order, fingerprint)))
            .await
    }
}

async fn open_seeds(db: &mut DbConnection) -> Result<Vec<(JobId, KeyOrder)>> {
    let mut found = Vec::new();
    for row in sqlx::query("SELECT id, spec FROM jobs WHERE kind = 3")
        .fetch_all(db)
        .await?
    {
        let spec = codec::decode_spec(JobKind::CreateKey, row.try_get("spec")?)?;
        if let JobSpec::CreateKey(order) = spec
            && matches!(order.seed, Some(Seed::Open(_)))
        {
            found.push((row.try_get("id")?, order));
        }
    }
    Ok(found)
}

async fn seal_seed(db: &mut DbConnection, job: JobId, order: &KeyOrder, fingerprint: [u8; 32]) -> Result<()> {
    sqlx::query("UPDATE jobs SET spec = $2, fingerprint = $3 WHERE id = $1 AND kind = 3")
        .bind(job)
        .bind(codec::encode_spec(&JobSpec::CreateKey(order.clone())))
        .bind(fingerprint.as_slice())
        .execute(db)
        .await?;
    Ok(())
}

pub(super) async fn create(db: &mut DbConnection, new: &NewKey, job: JobId, now: i64) -> Result<()> {
    sqlx::query(
        "INSERT INTO keys (id, display_name, bits, clip, clip_sha256, seeded, create_time, job_id, artifact_id, \
         project) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, (SELECT project FROM jobs WHERE id = $8))",
    )
    .bind(new.id)
    .bind(&new.display_name)
    .bind(i64::from(new.bits))
    .bind(&new.clip)
    .bind(&new.clip_sha256)
    .bind(new.seeded)
    .bind(now)
    .bind(job)
    .bind(new.artifact)
    .execute(db)
    .await?;
    Ok(())
}

pub(super) async fn get(db: &mut DbConnection, id: KeyId) -> Result<Option<KeyRow>> {
    let query = sqlx::query("SELECT * FROM keys WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(rows::key).transpose()
}

/// A key whose state stays what it is until the transaction ends.
pub(super) async fn get_meanwhile(db: &mut DbConnection, id: KeyId) -> Result<Option<KeyRow>> {
    let query = sqlx::query(concat!("SELECT * FROM keys WHERE id = $1", for_share!())).bind(id);
    query.fetch_optional(db).await?.as_ref().map(rows::key).transpose()
}

pub(super) async fn list(
    db: &mut DbConnection,
    project: &str,
    before: Option<(i64, KeyId)>,
    limit: u32,
) -> Result<Vec<KeyRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(PAGE).bind(time).bind(id).bind(i64::from(limit));
    let found = query.bind(project).fetch_all(db).await?;
    found.iter().map(rows::key).collect()
}

pub(super) async fn update_state(
    db: &mut DbConnection,
    id: KeyId,
    next: KeyState,
    reason: &str,
    now: i64,
) -> Result<KeyRow> {
    let query = sqlx::query(concat!("SELECT * FROM keys WHERE id = $1", for_update!())).bind(id);
    let row = query.fetch_optional(&mut *db).await?;
    let key = rows::key(&row.ok_or(LedgerError::NotFound { kind: "key", id })?)?;
    if key.state == next {
        return Ok(key);
    }
    if !key.state.may_become(next) {
        return Err(LedgerError::KeyStateFinal {
            key: id,
            state: key.state,
            wanted: next,
        });
    }
    let update =
        sqlx::query("UPDATE keys SET state = $2, state_reason = $3, state_time = $4 WHERE id = $1 RETURNING *");
    let row = update
        .bind(id)
        .bind(next as i32)
        .bind(reason)
        .bind(now)
        .fetch_one(db)
        .await?;
    rows::key(&row)
}
