//! Which delivery is sent next.
use std::time::Duration;

use sqlx::SqliteConnection;
use uuid::Uuid;

use super::super::hooks::{Busy, Sending};
use super::super::transition::end_of;
use super::super::{Result, token};
use super::{SqliteLedger, hooks};

/// The delivery that has been due for longest, to no hook of a JSON list of ids in hexadecimal, and of no project of another.
pub(super) const DUE: &str = "SELECT id FROM deliveries INDEXED BY deliveries_due \
    WHERE state = 1 AND next_time <= $1 AND lower(hex(hook_id)) NOT IN (SELECT value FROM json_each($2)) \
    AND project NOT IN (SELECT value FROM json_each($3)) \
    ORDER BY next_time, id LIMIT 1";

/// Gives out the delivery that has been due for longest.
pub(super) async fn claim(ledger: &SqliteLedger, busy: &Busy, lease: Duration, now: i64) -> Result<Option<Sending>> {
    let hooks: Vec<String> = busy.hooks.iter().map(|id| id.simple().to_string()).collect();
    let except = Except {
        hooks: serde_json::Value::from(hooks).to_string(),
        projects: serde_json::Value::from(busy.projects.clone()).to_string(),
    };
    // Mostly nothing is due, which a reader sees without holding up the writer.
    let looking = except.clone();
    let due = ledger.read(with!([looking] db => due(db, &looking, now))).await?;
    if due.is_none() {
        return Ok(None);
    }
    ledger.change(with!([except] db => take(db, &except, lease, now))).await
}

/// Who is busy, as JSON.
#[derive(Clone)]
struct Except {
    hooks: String,
    projects: String,
}

async fn due(db: &mut SqliteConnection, except: &Except, now: i64) -> Result<Option<Uuid>> {
    Ok(sqlx::query_scalar(DUE)
        .bind(now)
        .bind(&except.hooks)
        .bind(&except.projects)
        .fetch_optional(db)
        .await?)
}

async fn take(db: &mut SqliteConnection, except: &Except, lease: Duration, now: i64) -> Result<Option<Sending>> {
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
