//! Rows of owners and assets.
use guardsplat_commitment::SigningKey;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};
use uuid::Uuid;

use super::super::registry::{AssetFilter, AssetId, AssetRow, Candidate, NewAsset, NewOwner, OwnerId, OwnerRow};
use super::super::types::KeyId;
use super::super::{LedgerError, Result, again, chain};
use super::{commitments, keys, rows};

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
const ASSET: &str = assets!("WHERE a.id = ?1");
/// The asset that a request made.
const OF_REQUEST: &str = assets!("WHERE a.request_id = ?1");

/// A page of a project's assets.
pub(super) const ASSETS: &str = assets!(
    "WHERE a.project = ?6 AND (a.create_time, a.id) < (?1, ?2) ORDER BY a.create_time DESC, a.id DESC LIMIT ?3"
);
/// A page of an owner's. The plus keeps the planner from the index of projects, which has more to walk.
pub(super) const OF_OWNER: &str = assets!(
    "WHERE a.owner_id = ?4 AND +a.project = ?6 AND (a.create_time, a.id) < (?1, ?2) \
     ORDER BY a.create_time DESC, a.id DESC LIMIT ?3"
);
/// A page of a key's.
pub(super) const OF_KEY: &str = assets!(
    "WHERE a.key_id = ?5 AND +a.project = ?6 AND (a.create_time, a.id) < (?1, ?2) \
     ORDER BY a.create_time DESC, a.id DESC LIMIT ?3"
);
/// A page of an owner's that are of a key.
pub(super) const OF_BOTH: &str = assets!(
    "WHERE a.owner_id = ?4 AND a.key_id = ?5 AND +a.project = ?6 AND (a.create_time, a.id) < (?1, ?2) \
     ORDER BY a.create_time DESC, a.id DESC LIMIT ?3"
);

/// A page of a project's owners.
pub(super) const OWNERS: &str = "SELECT * FROM owners WHERE project = ?4 AND (create_time, id) < (?1, ?2) \
    ORDER BY create_time DESC, id DESC LIMIT ?3";

/// A page of what a search among a key's assets needs.
pub(super) const CANDIDATES: &str = "SELECT id, owner_id, payload, sealed_nonce FROM assets WHERE key_id = ?1 AND payload > ?2 ORDER BY payload LIMIT ?3";

/// The highest payload number of a key.
pub(super) const LAST_PAYLOAD: &str = "SELECT payload FROM assets WHERE key_id = ?1 ORDER BY payload DESC LIMIT 1";

pub(super) async fn create_owner(db: &mut SqliteConnection, new: NewOwner, now: i64) -> Result<OwnerRow> {
    if let Some(request) = new.request_id {
        let query = sqlx::query("SELECT * FROM owners WHERE request_id = ?1").bind(request.as_bytes().as_slice());
        if let Some(row) = query.fetch_optional(&mut *db).await? {
            return again::owner(request, owner(&row)?, &new);
        }
    }
    let insert = sqlx::query(
        "INSERT INTO owners (id, display_name, request_id, create_time, project) VALUES (?1, ?2, ?3, ?4, ?5) \
         RETURNING *",
    );
    let row = insert
        .bind(new.id.as_bytes().as_slice())
        .bind(&new.display_name)
        .bind(new.request_id.as_ref().map(|id| id.as_bytes().as_slice()))
        .bind(now)
        .bind(&new.project)
        .fetch_one(db)
        .await?;
    owner(&row)
}

pub(super) async fn get_owner(db: &mut SqliteConnection, id: OwnerId) -> Result<Option<OwnerRow>> {
    let query = sqlx::query("SELECT * FROM owners WHERE id = ?1").bind(id.as_bytes().as_slice());
    query.fetch_optional(db).await?.as_ref().map(owner).transpose()
}

pub(super) async fn list_owners(
    db: &mut SqliteConnection,
    project: &str,
    before: Option<(i64, OwnerId)>,
    limit: u32,
) -> Result<Vec<OwnerRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(OWNERS).bind(time).bind(id.as_bytes().as_slice());
    let found = query.bind(limit).bind(project);
    found.fetch_all(db).await?.iter().map(owner).collect()
}

/// Payload number, asset, and commitment in one transaction: numbers have no gaps, and the chain has no forks.
pub(super) async fn create_asset(
    db: &mut SqliteConnection,
    new: NewAsset,
    signer: &SigningKey,
    now: i64,
) -> Result<AssetRow> {
    if let Some(request) = new.request_id
        && let Some(there) = find_asset_request(db, request).await?
    {
        return again::asset(request, there, &new);
    }
    let missing = |kind, id| LedgerError::NotFound { kind, id };
    let owner = get_owner(db, new.owner).await?;
    let own = owner.filter(|owner| owner.project == new.project);
    own.ok_or_else(|| missing("owner", new.owner))?;
    let key = keys::get(db, new.key).await?;
    let own = key.filter(|key| key.project == new.project);
    let key = own.ok_or_else(|| missing("key", new.key))?;
    let last: Option<i64> = sqlx::query_scalar(LAST_PAYLOAD)
        .bind(new.key.as_bytes().as_slice())
        .fetch_optional(&mut *db)
        .await?;
    let asset = chain::numbered(&new, &key, last.unwrap_or(0), now)?;
    insert(db, &asset, &new.sealed_nonce, new.request_id).await?;
    commitments::append(db, &asset, new.nonce_hash, signer).await?;
    Ok(asset)
}

async fn insert(db: &mut SqliteConnection, asset: &AssetRow, sealed_nonce: &[u8], request: Option<Uuid>) -> Result<()> {
    sqlx::query(
        "INSERT INTO assets (id, owner_id, display_name, sha256, artifact_id, key_id, payload, sealed_nonce, \
         request_id, create_time, project) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
    )
    .bind(asset.id.as_bytes().as_slice())
    .bind(asset.owner.as_bytes().as_slice())
    .bind(&asset.display_name)
    .bind(asset.sha256.as_slice())
    .bind(asset.artifact.as_ref().map(|id| id.as_bytes().as_slice()))
    .bind(asset.key.as_bytes().as_slice())
    .bind(asset.payload)
    .bind(sealed_nonce)
    .bind(request.as_ref().map(|id| id.as_bytes().as_slice()))
    .bind(asset.create_time)
    .bind(&asset.project)
    .execute(db)
    .await?;
    Ok(())
}

pub(super) async fn find_asset_request(db: &mut SqliteConnection, request: Uuid) -> Result<Option<AssetRow>> {
    let query = sqlx::query(OF_REQUEST).bind(request.as_bytes().as_slice());
    query.fetch_optional(db).await?.as_ref().map(asset).transpose()
}

pub(super) async fn get_asset(db: &mut SqliteConnection, id: AssetId) -> Result<Option<AssetRow>> {
    let query = sqlx::query(ASSET).bind(id.as_bytes().as_slice());
    query.fetch_optional(db).await?.as_ref().map(asset).transpose()
}

pub(super) async fn list_assets(
    db: &mut SqliteConnection,
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
        .bind(id.as_bytes().as_slice())
        .bind(limit)
        .bind(filter.owner.as_ref().map(|id| id.as_bytes().as_slice()))
        .bind(filter.key.as_ref().map(|id| id.as_bytes().as_slice()))
        .bind(project);
    query.fetch_all(db).await?.iter().map(asset).collect()
}

pub(super) async fn candidates(
    db: &mut SqliteConnection,
    key: KeyId,
    after: i64,
    limit: u32,
) -> Result<Vec<Candidate>> {
    let query = sqlx::query(CANDIDATES).bind(key.as_bytes().as_slice());
    let found = query.bind(after).bind(limit).fetch_all(db).await?;
    found.iter().map(candidate_of).collect()
}

pub(super) async fn candidate(db: &mut SqliteConnection, asset: AssetId) -> Result<Option<Candidate>> {
    let query = sqlx::query("SELECT id, owner_id, payload, sealed_nonce FROM assets WHERE id = ?1");
    let found = query.bind(asset.as_bytes().as_slice()).fetch_optional(db).await?;
    found.as_ref().map(candidate_of).transpose()
}

fn candidate_of(row: &SqliteRow) -> Result<Candidate> {
    Ok(Candidate {
        asset: rows::id(row, "id")?,
        owner: rows::id(row, "owner_id")?,
        payload: row.try_get("payload")?,
        sealed_nonce: row.try_get("sealed_nonce")?,
    })
}

fn owner(row: &SqliteRow) -> Result<OwnerRow> {
    Ok(OwnerRow {
        id: rows::id(row, "id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        create_time: row.try_get("create_time")?,
    })
}

fn asset(row: &SqliteRow) -> Result<AssetRow> {
    Ok(AssetRow {
        id: rows::id(row, "id")?,
        project: row.try_get("project")?,
        commitment: rows::id(row, "commitment_id")?,
        owner: rows::id(row, "owner_id")?,
        display_name: row.try_get("display_name")?,
        sha256: rows::bytes(row, "sha256")?,
        artifact: rows::optional_id(row, "artifact_id")?,
        key: rows::id(row, "key_id")?,
        payload: row.try_get("payload")?,
        create_time: row.try_get("create_time")?,
    })
}
