//! Rows of tokens.
use sqlx::Row;
use uuid::Uuid;

use super::super::tokens::{NewToken, TokenId, TokenLedger, TokenRow};
use super::super::{LedgerError, Result};
use super::{DbConnection, DbLedger, DbRow, rows};
use crate::access::Scopes;

/// The token with a hash.
pub(super) const OF_HASH: &str = "SELECT * FROM tokens WHERE hash = $1";

/// A page of a project's.
pub(super) const OF_PROJECT: &str = "SELECT * FROM tokens WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// A page of all; there are few, and only an operator lists them.
const ALL: &str = "SELECT * FROM tokens WHERE (create_time, id) < ($1, $2) ORDER BY create_time DESC, id DESC LIMIT $3";

#[async_trait::async_trait]
impl TokenLedger for DbLedger {
    async fn create_token(&self, new: NewToken, now: i64) -> Result<TokenRow> {
        self.change(with!([new] db => create(db, &new, now))).await
    }

    async fn find_token(&self, hash: &[u8; 32]) -> Result<Option<TokenRow>> {
        let hash = *hash;
        self.read(with!([] db => find(db, hash))).await
    }

    async fn get_token(&self, id: TokenId) -> Result<Option<TokenRow>> {
        self.read(with!([] db => get(db, id))).await
    }

    async fn list_tokens(
        &self,
        project: Option<&str>,
        before: Option<(i64, TokenId)>,
        limit: u32,
    ) -> Result<Vec<TokenRow>> {
        let project = project.map(str::to_owned);
        self.read(with!([project] db => list(db, project.as_deref(), before, limit)))
            .await
    }

    async fn revoke_token(&self, id: TokenId, now: i64) -> Result<TokenRow> {
        self.change(with!([] db => revoke(db, id, now))).await
    }

    async fn touch_token(&self, id: TokenId, now: i64) -> Result<()> {
        self.change(with!([] db => touch(db, id, now))).await
    }
}

async fn create(db: &mut DbConnection, new: &NewToken, now: i64) -> Result<TokenRow> {
    let insert = sqlx::query(
        "INSERT INTO tokens (id, hash, display_name, project, scopes, create_time, expire_time) \
         VALUES ($1, $2, $3, $4, $5, $6, $7) RETURNING *",
    );
    let row = insert
        .bind(new.id)
        .bind(new.hash.as_slice())
        .bind(&new.display_name)
        .bind(&new.project)
        .bind(new.scopes.bits())
        .bind(now)
        .bind(new.expire_time)
        .fetch_one(db)
        .await?;
    token(&row)
}

async fn find(db: &mut DbConnection, hash: [u8; 32]) -> Result<Option<TokenRow>> {
    let found = sqlx::query(OF_HASH).bind(hash.as_slice()).fetch_optional(db).await?;
    found.as_ref().map(token).transpose()
}

async fn get(db: &mut DbConnection, id: TokenId) -> Result<Option<TokenRow>> {
    let query = sqlx::query("SELECT * FROM tokens WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(token).transpose()
}

async fn list(
    db: &mut DbConnection,
    project: Option<&str>,
    before: Option<(i64, TokenId)>,
    limit: u32,
) -> Result<Vec<TokenRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(if project.is_some() { OF_PROJECT } else { ALL })
        .bind(time)
        .bind(id)
        .bind(i64::from(limit))
        .bind(project);
    query.fetch_all(db).await?.iter().map(token).collect()
}

async fn revoke(db: &mut DbConnection, id: TokenId, now: i64) -> Result<TokenRow> {
    let update = sqlx::query("UPDATE tokens SET revoke_time = coalesce(revoke_time, $2) WHERE id = $1 RETURNING *");
    let row = update.bind(id).bind(now).fetch_optional(db).await?;
    token(&row.ok_or(LedgerError::NotFound { kind: "token", id })?)
}

async fn touch(db: &mut DbConnection, id: TokenId, now: i64) -> Result<()> {
    sqlx::query(concat!(
        "UPDATE tokens SET last_use_time = ",
        greatest!("coalesce(last_use_time, $2)", "$2"),
        " WHERE id = $1"
    ))
    .bind(id)
    .bind(now)
    .execute(db)
    .await?;
    Ok(())
}

fn token(row: &DbRow) -> Result<TokenRow> {
    let bits = rows::number(row, "scopes")?;
    Ok(TokenRow {
        id: row.try_get("id")?,
        display_name: row.try_get("display_name")?,
        project: row.try_get("project")?,
        scopes: Scopes::from_bits(bits).ok_or(LedgerError::Corrupt {
            what: "set of scopes",
            value: bits,
        })?,
        create_time: row.try_get("create_time")?,
        expire_time: row.try_get("expire_time")?,
        last_use_time: row.try_get("last_use_time")?,
        revoke_time: row.try_get("revoke_time")?,
    })
}
