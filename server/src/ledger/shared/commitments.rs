//! Rows of commitments, each of which follows on the one before, and of the key that they are signed with.
use guardsplat_commitment::{Hash, Signed, SigningKey};
use sqlx::Row;

use super::super::commitments::{CommitmentLog, SealedSigningKey};
use super::super::registry::{AssetRow, CommitmentId};
use super::super::{Result, chain};
use super::{DbConnection, DbLedger, DbRow, rows};

/// The end of the chain.
pub(super) const HEAD: &str = "SELECT * FROM commitments ORDER BY sequence DESC LIMIT 1";

/// The last of a project's.
const HEAD_OF: &str = concat!(
    "SELECT c.* FROM commitments c",
    in_order_join!(),
    "assets a ON a.id = c.asset_id WHERE a.project = $1 ORDER BY c.sequence DESC LIMIT 1"
);

/// A page of the chain, of what is a project's.
pub(super) const CHAIN: &str = concat!(
    "SELECT c.* FROM commitments c",
    in_order_join!(),
    "assets a ON a.id = c.asset_id WHERE c.sequence > $1 AND a.project = $3 ORDER BY c.sequence LIMIT $2"
);

#[async_trait::async_trait]
impl CommitmentLog for DbLedger {
    async fn signing_key(&self) -> Result<Option<SealedSigningKey>> {
        self.read(with!([] db => signing_key(db))).await
    }

    async fn keep_signing_key(&self, new: SealedSigningKey, now: i64) -> Result<SealedSigningKey> {
        self.change(with!([new] db => keep_signing_key(db, &new, now))).await
    }

    async fn get_commitment(&self, id: CommitmentId) -> Result<Option<Signed>> {
        self.read(with!([] db => get(db, id))).await
    }

    async fn list_commitments(&self, project: &str, after: i64, limit: u32) -> Result<Vec<Signed>> {
        let project = project.to_owned();
        self.read(with!([project] db => list(db, &project, after, limit))).await
    }

    async fn head(&self, project: &str) -> Result<Option<Signed>> {
        let project = project.to_owned();
        self.read(with!([project] db => head_of(db, &project))).await
    }
}

/// Signs a commitment to an asset behind the last one. It must run under `presence::lock_chain`, in the transaction that makes the
/// asset, so that nothing comes in between.
pub(super) async fn append(
    db: &mut DbConnection,
    asset: &AssetRow,
    nonce_hash: Hash,
    signer: &SigningKey,
) -> Result<()> {
    let (sequence, signed) = chain::next(head(db).await?.as_ref(), asset, nonce_hash, signer);
    sqlx::query(
        "INSERT INTO commitments (sequence, id, asset_id, canonical, hash, signature) VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(sequence)
    .bind(asset.commitment)
    .bind(asset.id)
    .bind(signed.commitment.canonical())
    .bind(signed.hash().as_slice())
    .bind(signed.signature.as_slice())
    .execute(db)
    .await?;
    Ok(())
}

pub(super) async fn head(db: &mut DbConnection) -> Result<Option<Signed>> {
    sqlx::query(HEAD)
        .fetch_optional(db)
        .await?
        .as_ref()
        .map(signed)
        .transpose()
}

pub(super) async fn head_of(db: &mut DbConnection, project: &str) -> Result<Option<Signed>> {
    let found = sqlx::query(HEAD_OF).bind(project).fetch_optional(db).await?;
    found.as_ref().map(signed).transpose()
}

pub(super) async fn get(db: &mut DbConnection, id: CommitmentId) -> Result<Option<Signed>> {
    let query = sqlx::query("SELECT * FROM commitments WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(signed).transpose()
}

pub(super) async fn list(db: &mut DbConnection, project: &str, after: i64, limit: u32) -> Result<Vec<Signed>> {
    let found = sqlx::query(CHAIN)
        .bind(after)
        .bind(i64::from(limit))
        .bind(project)
        .fetch_all(db)
        .await?;
    found.iter().map(signed).collect()
}

fn signed(row: &DbRow) -> Result<Signed> {
    let canonical: Vec<u8> = row.try_get("canonical")?;
    chain::read(row.try_get("sequence")?, &canonical, rows::bytes(row, "signature")?)
}

pub(super) async fn signing_key(db: &mut DbConnection) -> Result<Option<SealedSigningKey>> {
    let row = sqlx::query("SELECT * FROM signing_keys").fetch_optional(db).await?;
    row.map(|row| {
        Ok(SealedSigningKey {
            public_key: rows::bytes(&row, "public_key")?,
            sealed: row.try_get("sealed")?,
        })
    })
    .transpose()
}

/// Keeps the first one for good, and says which that is.
pub(super) async fn keep_signing_key(
    db: &mut DbConnection,
    new: &SealedSigningKey,
    now: i64,
) -> Result<SealedSigningKey> {
    sqlx::query(
        "INSERT INTO signing_keys (id, public_key, sealed, create_time) VALUES (1, $1, $2, $3) ON CONFLICT DO NOTHING",
    )
    .bind(new.public_key.as_slice())
    .bind(&new.sealed)
    .bind(now)
    .execute(&mut *db)
    .await?;
    Ok(signing_key(db).await?.unwrap_or_else(|| new.clone()))
}
