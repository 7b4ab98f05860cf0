//! Which delivery is sent next.
use std::time::Duration;

use sqlx::SqliteConnection;
use uuid::Uuid;

use super::super::hooks::{HookId, Sending};
use super::super::transition::end_of;
use super::super::{Result, token};
use super::{SqliteLedger, hooks};

/// The delivery that has been due for longest, to no hook of a JSON list of ids in hexadecimal.
pub(super) const DUE: &str = "SELECT id FROM deliveries INDEXED BY deliveries_due \
    WHERE state = 1 AND next_time <= $1 AND lower(hex(hook_id)) NOT IN (SELECT value FROM json_each($2)) \
    ORDER BY next_time, id LIMIT 1";

/// Gives out the delivery that has been due for longest.
pub(super) async fn claim(
    ledger: &SqliteLedger,
    except: &[HookId],
    lease: Duration,
    now: i64,
) -> Result<Option<Sending>> {
    let ids: Vec<String> = except.iter().map(|id| id.simple().to_string()).collect();
    let except = serde_json::Value::from(ids).to_string();
    // Mostly nothing is due, which a reader sees without holding up the writer.
    let hooks = except.clone();
    let due = ledger.read(with!([hooks] db => due(db, &hooks, now))).await?;
    if due.is_none() {
        return Ok(None);
    }
    ledger.change(with!([except] db => take(db, &except, lease, now))).await
}

async fn due(db: &mut SqliteConnection, except: &str, now: i64) -> Result<Option<Uuid>> {
    Ok(sqlx::query_scalar(DUE)
        .bind(now)
        .bind(except)
        .fetch_optional(db)
        .await?)
}

async fn take(db: &mut SqliteConnection, except: &str, lease: Duration, now: i64) -> Result<Option<Sending>> {
    let Some(id) = due(db, except, now).await? else {
        return Ok(None);
    };
    let token = token::fresh();
    let update = sqlx::query(
        "UPDATE deliveries SET attempts = attempts + 1, lease_token = $2, next_time = $3, last_time = $4 \
         WHERE id = $1 RETURNING *",
    );
    let row = update
        .bind(id)
        .bind(token::hash(&token))
        .bind(end_of(lease, now))
        .bind(now)
        .fetch_one(&mut *db)
        .await?;
    hooks::sending(db, &row, token).await.map(Some)
}
