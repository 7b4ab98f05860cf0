//! Rows of tokens.
use sqlx::postgres::PgRow;
use sqlx::{PgConnection, Row};
use uuid::Uuid;

use super::super::access::{AccessLedger, NewToken, TokenId, TokenRow, Usage};
use super::super::{ArtifactId, LedgerError, Result};
use super::{PostgresLedger, rows, with};
use crate::access::Scopes;

/// The token with a hash.
pub(super) const OF_HASH: &str = "SELECT * FROM tokens WHERE hash = $1";

/// A page of a project's.
pub(super) const OF_PROJECT: &str = "SELECT * FROM tokens WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// What a project takes; both from indexes alone. A sum of bigints is of another type.
pub(super) const USAGE: &str = "SELECT \
    (SELECT count(*) FROM jobs WHERE project = $1 AND state = 1) AS queued_jobs, \
    (SELECT coalesce(sum(size), 0)::bigint FROM artifacts WHERE project = $1 AND state IN (2, 3)) AS artifact_bytes";

/// A page of all; there are few, and only an operator lists them.
const ALL: &str = "SELECT * FROM tokens WHERE (create_time, id) < ($1, $2) ORDER BY create_time DESC, id DESC LIMIT $3";

#[tonic::async_trait]
impl AccessLedger for PostgresLedger {
    async fn create_token(&self, new: NewToken, now: i64) -> Result<TokenRow> {
        self.database.change(with!([new] db => create(db, &new, now))).await
    }

    async fn find_token(&self, hash: &[u8; 32]) -> Result<Option<TokenRow>> {
        let hash = *hash;
        self.database.read(with!([] db => find(db, hash))).await
    }

    async fn get_token(&self, id: TokenId) -> Result<Option<TokenRow>> {
        self.database.read(with!([] db => get(db, id))).await
    }

    async fn list_tokens(
        &self,
        project: Option<&str>,
        before: Option<(i64, TokenId)>,
        limit: u32,
    ) -> Result<Vec<TokenRow>> {
        let project = project.map(str::to_owned);
        self.database
            .read(with!([project] db => list(db, project.as_deref(), before, limit)))
            .await
    }

    async fn revoke_token(&self, id: TokenId, now: i64) -> Result<TokenRow> {
        self.database.change(with!([] db => revoke(db, id, now))).await
    }

    async fn usage(&self, project: &str) -> Result<Usage> {
        let project = project.to_owned();
        self.database.read(with!([project] db => usage(db, &project))).await
    }

    async fn is_being_read(&self, artifact: ArtifactId) -> Result<bool> {
        self.database.read(with!([] db => is_being_read(db, artifact))).await
    }

    async fn touch_token(&self, id: TokenId, now: i64) -> Result<()> {
        self.database.change(with!([] db => touch(db, id, now))).await
    }
}

async fn create(db: &mut PgConnection, new: &NewToken, now: i64) -> Result<TokenRow> {
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

async fn find(db: &mut PgConnection, hash: [u8; 32]) -> Result<Option<TokenRow>> {
    let found = sqlx::query(OF_HASH).bind(hash.as_slice()).fetch_optional(db).await?;
    found.as_ref().map(token).transpose()
}

async fn get(db: &mut PgConnection, id: TokenId) -> Result<Option<TokenRow>> {
    let query = sqlx::query("SELECT * FROM tokens WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(token).transpose()
}

async fn list(
    db: &mut PgConnection,
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

async fn revoke(db: &mut PgConnection, id: TokenId, now: i64) -> Result<TokenRow> {
    let update = sqlx::query("UPDATE tokens SET revoke_time = coalesce(revoke_time, $2) WHERE id = $1 RETURNING *");
    let row = update.bind(id).bind(now).fetch_optional(db).await?;
    token(&row.ok_or(LedgerError::NotFound { kind: "token", id })?)
}

async fn usage(db: &mut PgConnection, project: &str) -> Result<Usage> {
    let row = sqlx::query(USAGE).bind(project).fetch_one(db).await?;
    let number = |column| Ok::<_, LedgerError>(u64::try_from(row.try_get::<i64, _>(column)?).unwrap_or_default());
    Ok(Usage {
        queued_jobs: number("queued_jobs")?,
        artifact_bytes: number("artifact_bytes")?,
    })
}

async fn is_being_read(db: &mut PgConnection, artifact: ArtifactId) -> Result<bool> {
    let query = sqlx::query(
        "SELECT 1 FROM job_inputs i JOIN jobs j ON j.id = i.job_id WHERE i.artifact_id = $1 AND j.state = 2 LIMIT 1",
    );
    Ok(query.bind(artifact).fetch_optional(db).await?.is_some())
}

async fn touch(db: &mut PgConnection, id: TokenId, now: i64) -> Result<()> {
    // Of null and a time the time is the greatest.
    sqlx::query("UPDATE tokens SET last_use_time = greatest(last_use_time, $2) WHERE id = $1")
        .bind(id)
        .bind(now)
        .execute(db)
        .await?;
    Ok(())
}

fn token(row: &PgRow) -> Result<TokenRow> {
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
