//! Rows of hooks and deliveries.
use std::time::Duration;

use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};
use uuid::Uuid;

use super::super::hooks::{
    DeliveryFilter, DeliveryId, DeliveryRow, DeliveryState, HookId, HookLedger, HookRow, NewHook, Sending, Topics,
    kind_bit, state_bit,
};
use super::super::transition::end_of;
use super::super::types::JobRow;
use super::super::{LedgerError, Result, numbers, token};
use super::{SqliteLedger, jobs, rows};

/// A page of a project's hooks.
pub(super) const HOOKS: &str = "SELECT * FROM hooks WHERE project = ?4 AND (create_time, id) < (?1, ?2) \
    ORDER BY create_time DESC, id DESC LIMIT ?3";

/// A page of a project's deliveries.
pub(super) const OF_PROJECT: &str = "SELECT * FROM deliveries \
    WHERE project = ?4 AND (?5 IS NULL OR state = ?5) AND (create_time, id) < (?1, ?2) \
    ORDER BY create_time DESC, id DESC LIMIT ?3";

/// A page of those to one hook.
pub(super) const OF_HOOK: &str = "SELECT * FROM deliveries \
    WHERE hook_id = ?4 AND (?5 IS NULL OR state = ?5) AND (create_time, id) < (?1, ?2) \
    ORDER BY create_time DESC, id DESC LIMIT ?3";

/// The delivery that has been due for longest, to no hook of a JSON list of ids in hexadecimal.
pub(super) const DUE: &str = "SELECT id FROM deliveries INDEXED BY deliveries_due \
    WHERE state = 1 AND next_time <= ?1 AND lower(hex(hook_id)) NOT IN (SELECT value FROM json_each(?2)) \
    ORDER BY next_time, id LIMIT 1";

#[tonic::async_trait]
impl HookLedger for SqliteLedger {
    async fn create_hook(&self, new: NewHook, now: i64) -> Result<HookRow> {
        self.writer.run(move |db| Box::pin(create(db, new, now))).await
    }

    async fn get_hook(&self, id: HookId) -> Result<Option<HookRow>> {
        get(&mut *self.readers.acquire().await?, id).await
    }

    async fn list_hooks(&self, project: &str, before: Option<(i64, HookId)>, limit: u32) -> Result<Vec<HookRow>> {
        let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
        let query = sqlx::query(HOOKS).bind(time).bind(id.as_bytes().as_slice());
        let query = query.bind(limit).bind(project);
        let found = query.fetch_all(&mut *self.readers.acquire().await?).await?;
        found.iter().map(hook).collect()
    }

    async fn delete_hook(&self, id: HookId) -> Result<()> {
        self.writer.run(move |db| Box::pin(delete(db, id))).await
    }

    async fn get_delivery(&self, id: DeliveryId) -> Result<Option<DeliveryRow>> {
        let query = sqlx::query("SELECT * FROM deliveries WHERE id = ?1").bind(id.as_bytes().as_slice());
        let found = query.fetch_optional(&mut *self.readers.acquire().await?).await?;
        found.as_ref().map(delivery).transpose()
    }

    async fn list_deliveries(
        &self,
        project: &str,
        filter: DeliveryFilter,
        before: Option<(i64, DeliveryId)>,
        limit: u32,
    ) -> Result<Vec<DeliveryRow>> {
        let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
        let page = sqlx::query(if filter.hook.is_some() { OF_HOOK } else { OF_PROJECT });
        let page = page.bind(time).bind(id.as_bytes().as_slice()).bind(limit);
        let page = match &filter.hook {
            Some(hook) => page.bind(hook.as_bytes().as_slice()),
            None => page.bind(project),
        };
        let query = page.bind(filter.state.map(|state| state as i64));
        let found = query.fetch_all(&mut *self.readers.acquire().await?).await?;
        found.iter().map(delivery).collect()
    }

    async fn redeliver(&self, id: DeliveryId, now: i64) -> Result<DeliveryRow> {
        self.writer.run(move |db| Box::pin(redeliver(db, id, now))).await
    }

    async fn claim_delivery(&self, except: &[HookId], lease: Duration, now: i64) -> Result<Option<Sending>> {
        let ids: Vec<String> = except.iter().map(|id| id.simple().to_string()).collect();
        let except = serde_json::Value::from(ids).to_string();
        // Mostly nothing is due, which a reader sees without holding up the writer.
        let due = sqlx::query(DUE).bind(now).bind(&except);
        if due.fetch_optional(&mut *self.readers.acquire().await?).await?.is_none() {
            return Ok(None);
        }
        self.writer.run(move |db| Box::pin(claim(db, except, lease, now))).await
    }

    async fn delivered(&self, id: DeliveryId, token: &str, now: i64) -> Result<bool> {
        let token = token::hash(token);
        self.writer.run(move |db| Box::pin(delivered(db, id, token, now))).await
    }

    async fn not_delivered(
        &self,
        id: DeliveryId,
        token: &str,
        error: &str,
        next: Option<i64>,
        now: i64,
    ) -> Result<bool> {
        let (token, error) = (token::hash(token), error.to_owned());
        self.writer
            .run(move |db| Box::pin(not_delivered(db, id, token, error, next, now)))
            .await
    }

    async fn forget_deliveries(&self, older_than: i64, limit: u32) -> Result<u64> {
        self.writer.run(move |db| Box::pin(forget(db, older_than, limit))).await
    }
}

/// Makes a delivery for every hook that wants to know of a job that is over; in the transaction that ends it.
pub(super) async fn announce(db: &mut SqliteConnection, job: &JobRow, now: i64) -> Result<()> {
    let wanting = sqlx::query(
        "SELECT id FROM hooks WHERE project = ?1 AND (kinds = 0 OR kinds & ?2 <> 0) AND (states = 0 OR states & ?3 <> 0)",
    );
    let wanting = wanting
        .bind(&job.project)
        .bind(kind_bit(job.kind))
        .bind(state_bit(job.state))
        .fetch_all(&mut *db)
        .await?;
    for row in wanting {
        let hook: Vec<u8> = row.try_get("id")?;
        let insert = sqlx::query(
            "INSERT INTO deliveries (id, hook_id, project, job_id, job_state, create_time, since, next_time) \
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?6, ?6)",
        );
        insert
            .bind(Uuid::now_v7().as_bytes().as_slice())
            .bind(hook)
            .bind(&job.project)
            .bind(job.id.as_bytes().as_slice())
            .bind(job.state as i64)
            .bind(now)
            .execute(&mut *db)
            .await?;
    }
    Ok(())
}

async fn create(db: &mut SqliteConnection, new: NewHook, now: i64) -> Result<HookRow> {
    let (kinds, states) = new.topics.bits();
    let insert = sqlx::query(
        "INSERT INTO hooks (id, project, display_name, url, kinds, states, sealed_secret, create_time) \
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8) RETURNING *",
    );
    let row = insert
        .bind(new.id.as_bytes().as_slice())
        .bind(&new.project)
        .bind(&new.display_name)
        .bind(&new.url)
        .bind(kinds)
        .bind(states)
        .bind(&new.sealed_secret)
        .bind(now)
        .fetch_one(db)
        .await?;
    hook(&row)
}

async fn get(db: &mut SqliteConnection, id: HookId) -> Result<Option<HookRow>> {
    let query = sqlx::query("SELECT * FROM hooks WHERE id = ?1").bind(id.as_bytes().as_slice());
    query.fetch_optional(db).await?.as_ref().map(hook).transpose()
}

async fn delete(db: &mut SqliteConnection, id: HookId) -> Result<()> {
    let query = sqlx::query("DELETE FROM hooks WHERE id = ?1").bind(id.as_bytes().as_slice());
    match query.execute(db).await?.rows_affected() {
        0 => Err(LedgerError::NotFound { kind: "hook", id }),
        _ => Ok(()),
    }
}

async fn redeliver(db: &mut SqliteConnection, id: DeliveryId, now: i64) -> Result<DeliveryRow> {
    let update = sqlx::query(
        "UPDATE deliveries SET state = 1, attempts = 0, since = ?2, next_time = ?2, end_time = NULL, lease_token = NULL \
         WHERE id = ?1 AND NOT (lease_token IS NOT NULL AND next_time > ?2)",
    );
    update
        .bind(id.as_bytes().as_slice())
        .bind(now)
        .execute(&mut *db)
        .await?;
    let query = sqlx::query("SELECT * FROM deliveries WHERE id = ?1").bind(id.as_bytes().as_slice());
    let row = query.fetch_optional(db).await?;
    delivery(&row.ok_or(LedgerError::NotFound { kind: "delivery", id })?)
}

async fn claim(db: &mut SqliteConnection, except: String, lease: Duration, now: i64) -> Result<Option<Sending>> {
    let due = sqlx::query(DUE).bind(now).bind(except).fetch_optional(&mut *db).await?;
    let Some(due) = due else { return Ok(None) };
    let token = token::fresh();
    let update = sqlx::query(
        "UPDATE deliveries SET attempts = attempts + 1, lease_token = ?2, next_time = ?3, last_time = ?4 \
         WHERE id = ?1 RETURNING *",
    );
    let row = update
        .bind(rows::id(&due, "id")?.as_bytes().as_slice())
        .bind(token::hash(&token))
        .bind(end_of(lease, now))
        .bind(now)
        .fetch_one(&mut *db)
        .await?;
    let delivery = delivery(&row)?;
    let hook = get(db, delivery.hook).await?.ok_or(LedgerError::NotFound {
        kind: "hook",
        id: delivery.hook,
    })?;
    let job = jobs::by_id(db, delivery.job).await?;
    let asked_id = match &job {
        Some(row) => rows::optional_id(row, "asked_id")?.or(rows::optional_id(row, "request_id")?),
        None => None,
    };
    Ok(Some(Sending {
        delivery,
        hook,
        job: job.as_ref().map(rows::job).transpose()?,
        asked_id,
        token,
    }))
}

async fn delivered(db: &mut SqliteConnection, id: DeliveryId, token: Vec<u8>, now: i64) -> Result<bool> {
    let update = sqlx::query(
        "UPDATE deliveries SET state = 2, last_error = '', lease_token = NULL, end_time = ?3 \
         WHERE id = ?1 AND lease_token = ?2",
    );
    let update = update.bind(id.as_bytes().as_slice()).bind(token).bind(now);
    Ok(update.execute(db).await?.rows_affected() > 0)
}

async fn not_delivered(
    db: &mut SqliteConnection,
    id: DeliveryId,
    token: Vec<u8>,
    error: String,
    next: Option<i64>,
    now: i64,
) -> Result<bool> {
    let update = sqlx::query(
        "UPDATE deliveries SET state = iif(?4 IS NULL, 3, 1), next_time = coalesce(?4, next_time), \
         end_time = iif(?4 IS NULL, ?5, NULL), last_error = ?3, lease_token = NULL WHERE id = ?1 AND lease_token = ?2",
    );
    let update = update.bind(id.as_bytes().as_slice()).bind(token).bind(error);
    Ok(update.bind(next).bind(now).execute(db).await?.rows_affected() > 0)
}

async fn forget(db: &mut SqliteConnection, older_than: i64, limit: u32) -> Result<u64> {
    let delete = sqlx::query(
        "DELETE FROM deliveries WHERE id IN (SELECT id FROM deliveries WHERE state > 1 AND end_time < ?1 LIMIT ?2)",
    );
    Ok(delete.bind(older_than).bind(limit).execute(db).await?.rows_affected())
}

fn hook(row: &SqliteRow) -> Result<HookRow> {
    Ok(HookRow {
        id: rows::id(row, "id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        url: row.try_get("url")?,
        topics: Topics::from_bits(row.try_get("kinds")?, row.try_get("states")?)?,
        sealed_secret: row.try_get("sealed_secret")?,
        create_time: row.try_get("create_time")?,
    })
}

fn delivery(row: &SqliteRow) -> Result<DeliveryRow> {
    Ok(DeliveryRow {
        id: rows::id(row, "id")?,
        hook: rows::id(row, "hook_id")?,
        project: row.try_get("project")?,
        job: rows::id(row, "job_id")?,
        job_state: numbers::job_state(row.try_get("job_state")?)?,
        state: DeliveryState::of_number(row.try_get("state")?)?,
        attempts: row.try_get("attempts")?,
        last_error: row.try_get("last_error")?,
        create_time: row.try_get("create_time")?,
        since: row.try_get("since")?,
        next_time: row.try_get("next_time")?,
        last_time: row.try_get("last_time")?,
        end_time: row.try_get("end_time")?,
    })
}
