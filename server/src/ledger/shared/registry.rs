//! Rows of owners and assets.
use std::sync::Arc;

use guardsplat_commitment::SigningKey;
use sqlx::Row;
use uuid::Uuid;

use super::super::registry::{
    AssetFilter, AssetId, AssetRow, Candidate, NewAsset, NewOwner, OwnerId, OwnerRow, Registry,
};
use super::super::types::KeyId;
use super::super::{LedgerError, Result, chain, idempotency};
use super::{DbConnection, DbLedger, DbRow, commitments, history, keys, presence, rows};

/// Assets with the names of their commitments.
macro_rules! assets {
    ($rest:literal) => {
        concat!(
            "SELECT a.*, c.id AS commitment_id FROM assets a JOIN commitments c ON c.asset_id = a.id ",
            $rest
        )
    };
}

/// One asset.
const ASSET: &str = assets!("WHERE a.id = $1");
/// The asset that a request made.
const OF_REQUEST: &str = assets!("WHERE a.request_id = $1");

/// A page of a project's assets.
pub(super) const ASSETS: &str = assets!(
    "WHERE a.project = $6 AND (a.create_time, a.id) < ($1, $2) ORDER BY a.create_time DESC, a.id DESC LIMIT $3"
);
/// A page of an owner's. The empty text keeps the planner from the index of projects, which has more to walk.
pub(super) const OF_OWNER: &str = assets!(
    "WHERE a.owner_id = $4 AND a.project || '' = $6 AND (a.create_time, a.id) < ($1, $2) \
     ORDER BY a.create_time DESC, a.id DESC LIMIT $3"
);
/// A page of a key's.
pub(super) const OF_KEY: &str = assets!(
    "WHERE a.key_id = $5 AND a.project || '' = $6 AND (a.create_time, a.id) < ($1, $2) \
     ORDER BY a.create_time DESC, a.id DESC LIMIT $3"
);
/// A page of an owner's that are of a key.
pub(super) const OF_BOTH: &str = assets!(
    "WHERE a.owner_id = $4 AND a.key_id = $5 AND a.project || '' = $6 AND (a.create_time, a.id) < ($1, $2) \
     ORDER BY a.create_time DESC, a.id DESC LIMIT $3"
);

/// A page of a project's owners.
pub(super) const OWNERS: &str = "SELECT * FROM owners WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// A page of what a search among a key's assets requirements.
pub(super) const CANDIDATES: &str = "SELECT id, owner_id, sha256, payload, sealed_nonce FROM assets WHERE key_id = $1 AND payload > $2 ORDER BY payload LIMIT $3";

/// The highest payload number of a key.
pub(super) const LAST_PAYLOAD: &str = "SELECT payload FROM assets WHERE key_id = $1 ORDER BY payload DESC LIMIT 1";

#[async_trait::async_trait]
impl Registry for DbLedger {
    async fn create_owner(&self, new: NewOwner, now: i64) -> Result<OwnerRow> {
        self.change(with!([new] db => create_owner(db, &new, now))).await
    }

    async fn get_owner(&self, id: OwnerId) -> Result<Option<OwnerRow>> {
        self.read(with!([] db => get_owner(db, id))).await
    }

    async fn list_owners(&self, project: &str, before: Option<(i64, OwnerId)>, limit: u32) -> Result<Vec<OwnerRow>> {
        let project = project.to_owned();
        self.read(with!([project] db => list_owners(db, &project, before, limit)))
            .await
    }

    async fn create_asset(&self, new: NewAsset, signer: Arc<SigningKey>, now: i64) -> Result<AssetRow> {
        self.change(with!([new, signer] db => create_asset(db, &new, &signer, now)))
            .await
    }

    async fn find_asset_request(&self, request: Uuid) -> Result<Option<AssetRow>> {
        self.read(with!([] db => find_asset_request(db, request))).await
    }

    async fn get_asset(&self, id: AssetId) -> Result<Option<AssetRow>> {
        self.read(with!([] db => get_asset(db, id))).await
    }

    async fn list_assets(
        &self,
        project: &str,
        filter: AssetFilter,
        before: Option<(i64, AssetId)>,
        limit: u32,
    ) -> Result<Vec<AssetRow>> {
        let project = project.to_owned();
        self.read(with!([project] db => list_assets(db, &project, filter, before, limit)))
            .await
    }

    async fn candidates(&self, key: KeyId, after: i64, limit: u32) -> Result<Vec<Candidate>> {
        self.read(with!([] db => candidates(db, key, after, limit))).await
    }

    async fn count_assets(&self, key: KeyId, owner: Option<OwnerId>) -> Result<u64> {
        self.read(with!([] db => count_assets(db, key, owner))).await
    }

    async fn reveal_asset(&self, asset: AssetId, now: i64) -> Result<AssetRow> {
        self.change(with!([] db => reveal(db, asset, now))).await
    }

    async fn candidate(&self, asset: AssetId) -> Result<Option<Candidate>> {
        self.read(with!([] db => candidate(db, asset))).await
    }
}

pub(super) async fn create_owner(db: &mut DbConnection, new: &NewOwner, now: i64) -> Result<OwnerRow> {
    if let Some(there) = owner_made_before(db, new).await? {
        return Ok(there);
    }
    let insert = sqlx::query(
        "INSERT INTO owners (id, display_name, request_id, create_time, project) VALUES ($1, $2, $3, $4, $5) \
         ON CONFLICT (request_id) DO NOTHING RETURNING *",
    );
    let row = insert
        .bind(new.id)
        .bind(&new.display_name)
        .bind(new.request_id)
        .bind(now)
        .bind(&new.project)
        .fetch_optional(&mut *db)
        .await?;
    match row {
        Some(row) => owner(&row),
        // The same request, at the same time; by now it has been carried out.
        None => {
            let there = owner_made_before(db, new).await?;
            there.ok_or_else(|| sqlx::Error::RowNotFound.into())
        }
    }
}

async fn owner_made_before(db: &mut DbConnection, new: &NewOwner) -> Result<Option<OwnerRow>> {
    let Some(request) = new.request_id else { return Ok(None) };
    let query = sqlx::query("SELECT * FROM owners WHERE request_id = $1").bind(request);
    let found = query.fetch_optional(db).await?;
    found
        .map(|row| idempotency::owner(request, owner(&row)?, new))
        .transpose()
}

pub(super) async fn get_owner(db: &mut DbConnection, id: OwnerId) -> Result<Option<OwnerRow>> {
    let query = sqlx::query("SELECT * FROM owners WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(owner).transpose()
}

pub(super) async fn list_owners(
    db: &mut DbConnection,
    project: &str,
    before: Option<(i64, OwnerId)>,
    limit: u32,
) -> Result<Vec<OwnerRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(OWNERS).bind(time).bind(id).bind(i64::from(limit));
    query.bind(project).fetch_all(db).await?.iter().map(owner).collect()
}

/// Payload number, asset, and commitment in one transaction, and one such transaction at a time: numbers have no gaps,
/// and the chain has no forks.
pub(super) async fn create_asset(
    db: &mut DbConnection,
    new: &NewAsset,
    signer: &SigningKey,
    now: i64,
) -> Result<AssetRow> {
    presence::lock_chain(db).await?;
    if let Some(request) = new.request_id
        && let Some(there) = find_asset_request(db, request).await?
    {
        return idempotency::asset(request, there, new);
    }
    let missing = |kind, id| LedgerError::NotFound { kind, id };
    let owner = get_owner(db, new.owner).await?;
    let own = owner.filter(|owner| owner.project == new.project);
    own.ok_or_else(|| missing("owner", new.owner))?;
    // It is not retired before the asset is there.
    let key = keys::get_meanwhile(db, new.key).await?;
    let own = key.filter(|key| key.project == new.project);
    let key = own.ok_or_else(|| missing("key", new.key))?;
    let last: Option<i64> = sqlx::query_scalar(LAST_PAYLOAD)
        .bind(new.key)
        .fetch_optional(&mut *db)
        .await?;
    let asset = chain::numbered(new, &key, last.unwrap_or(0), now)?;
    // The original does not go by age before the asset is there to name it; it may be gone all the same.
    sqlx::query(concat!("SELECT 1 FROM artifacts WHERE id = $1", for_share!()))
        .bind(asset.artifact)
        .fetch_optional(&mut *db)
        .await?;
    insert(db, &asset, &new.sealed_nonce, new.request_id).await?;
    commitments::append(db, &asset, new.nonce_hash, signer).await?;
    Ok(asset)
}

async fn insert(db: &mut DbConnection, asset: &AssetRow, sealed_nonce: &[u8], request: Option<Uuid>) -> Result<()> {
    sqlx::query(
        "INSERT INTO assets (id, owner_id, display_name, sha256, artifact_id, key_id, payload, sealed_nonce, \
         request_id, create_time, project) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)",
    )
    .bind(asset.id)
    .bind(asset.owner)
    .bind(&asset.display_name)
    .bind(asset.sha256.as_slice())
    .bind(asset.artifact)
    .bind(asset.key)
    .bind(asset.payload)
    .bind(sealed_nonce)
    .bind(request)
    .bind(asset.create_time)
    .bind(&asset.project)
    .execute(db)
    .await?;
    Ok(())
}

pub(super) async fn find_asset_request(db: &mut DbConnection, request: Uuid) -> Result<Option<AssetRow>> {
    let query = sqlx::query(OF_REQUEST).bind(request);
    query.fetch_optional(db).await?.as_ref().map(asset).transpose()
}

pub(super) async fn get_asset(db: &mut DbConnection, id: AssetId) -> Result<Option<AssetRow>> {
    let query = sqlx::query(ASSET).bind(id);
    query.fetch_optional(db).await?.as_ref().map(asset).transpose()
}

pub(super) async fn list_assets(
    db: &mut DbConnection,
    project: &str,
    filter: AssetFilter,
    before: Option<(i64, AssetId)>,
    limit: u32,
) -> Result<Vec<AssetRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let statement = match (filter.owner, filter.key) {
        (None, None) => ASSETS,
        (Some(_), None) => OF_OWNER,
        (None, Some(_)) => OF_KEY,
        (Some(_), Some(_)) => OF_BOTH,
    };
    let query = sqlx::query(statement)
        .bind(time)
        .bind(id)
        .bind(i64::from(limit))
        .bind(filter.owner)
        .bind(filter.key)
        .bind(project);
    query.fetch_all(db).await?.iter().map(asset).collect()
}

pub(super) async fn candidates(db: &mut DbConnection, key: KeyId, after: i64, limit: u32) -> Result<Vec<Candidate>> {
    let query = sqlx::query(CANDIDATES).bind(key);
    let found = query.bind(after).bind(i64::from(limit)).fetch_all(db).await?;
    found.iter().map(candidate_of).collect()
}

pub(super) async fn candidate(db: &mut DbConnection, asset: AssetId) -> Result<Option<Candidate>> {
    let query = sqlx::query("SELECT id, owner_id, sha256, payload, sealed_nonce FROM assets WHERE id = $1");
    let found = query.bind(asset).fetch_optional(db).await?;
    found.as_ref().map(candidate_of).transpose()
}

/// Payload numbers have no gaps, so the last one counts them all.
async fn count_assets(db: &mut DbConnection, key: KeyId, owner: Option<OwnerId>) -> Result<u64> {
    let Some(owner) = owner else {
        let last: Option<i64> = sqlx::query_scalar(LAST_PAYLOAD).bind(key).fetch_optional(db).await?;
        return history::count(last.unwrap_or(0));
    };
    let of_owner = sqlx::query_scalar("SELECT count(*) FROM assets WHERE owner_id = $1 AND key_id = $2");
    history::count(of_owner.bind(owner).bind(key).fetch_one(db).await?)
}

async fn reveal(db: &mut DbConnection, id: AssetId, now: i64) -> Result<AssetRow> {
    sqlx::query("UPDATE assets SET reveal_time = $2 WHERE id = $1 AND reveal_time IS NULL")
        .bind(id)
        .bind(now)
        .execute(&mut *db)
        .await?;
    let asset = get_asset(db, id).await?;
    asset.ok_or(LedgerError::NotFound { kind: "asset", id })
}

fn candidate_of(row: &DbRow) -> Result<Candidate> {
    Ok(Candidate {
        asset: row.try_get("id")?,
        owner: row.try_get("owner_id")?,
        sha256: rows::bytes(row, "sha256")?,
        payload: row.try_get("payload")?,
        sealed_nonce: row.try_get("sealed_nonce")?,
    })
}

fn owner(row: &DbRow) -> Result<OwnerRow> {
    Ok(OwnerRow {
        id: row.try_get("id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        create_time: row.try_get("create_time")?,
    })
}

fn asset(row: &DbRow) -> Result<AssetRow> {
    Ok(AssetRow {
        id: row.try_get("id")?,
        project: row.try_get("project")?,
        commitment: row.try_get("commitment_id")?,
        owner: row.try_get("owner_id")?,
        display_name: row.try_get("display_name")?,
        sha256: rows::bytes(row, "sha256")?,
        artifact: row.try_get("artifact_id")?,
        key: row.try_get("key_id")?,
        payload: row.try_get("payload")?,
        create_time: row.try_get("create_time")?,
        reveal_time: row.try_get("reveal_time")?,
    })
}
