//! Rows of hooks and deliveries.
use std::time::Duration;

use sqlx::Row;
use uuid::Uuid;

use super::super::hooks::{
    Busy, DeliveryFilter, DeliveryId, DeliveryRow, DeliveryState, HookId, HookLedger, HookRow, MOST_WAITING, NewHook,
    Sending, Topics, kind_bit, state_bit,
};
use super::super::types::JobRow;
use super::super::{LedgerError, Result, discriminants, token};
use super::{DbConnection, DbLedger, DbRow, deliveries, rows, storable};

/// A page of a project's hooks.
pub(super) const HOOKS: &str = "SELECT * FROM hooks WHERE project = $4 AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// A page of a project's deliveries.
pub(super) const OF_PROJECT: &str = "SELECT * FROM deliveries \
    WHERE project = $4 AND ($5 IS NULL OR state = $5) AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// A page of those to one hook.
pub(super) const OF_HOOK: &str = "SELECT * FROM deliveries \
    WHERE hook_id = $4 AND ($5 IS NULL OR state = $5) AND (create_time, id) < ($1, $2) \
    ORDER BY create_time DESC, id DESC LIMIT $3";

/// How many of a project's wait; no more are counted than there may be.
pub(super) const WAITING: &str =
    "SELECT count(*) FROM (SELECT 1 FROM deliveries WHERE project = $1 AND state = 1 LIMIT $2) AS waiting";

/// Why a delivery was never tried.
const TOO_MANY: &str = "never sent: 10000 others of the project were waiting";

#[async_trait::async_trait]
impl HookLedger for DbLedger {
    async fn create_hook(&self, new: NewHook, now: i64) -> Result<HookRow> {
        self.change(with!([new] db => create(db, &new, now))).await
    }

    async fn get_hook(&self, id: HookId) -> Result<Option<HookRow>> {
        self.read(with!([] db => get(db, id))).await
    }

    async fn list_hooks(&self, project: &str, before: Option<(i64, HookId)>, limit: u32) -> Result<Vec<HookRow>> {
        let project = project.to_owned();
        self.read(with!([project] db => list(db, &project, before, limit)))
            .await
    }

    async fn delete_hook(&self, id: HookId) -> Result<()> {
        self.change(with!([] db => delete(db, id))).await
    }

    async fn get_delivery(&self, id: DeliveryId) -> Result<Option<DeliveryRow>> {
        self.read(with!([] db => get_delivery(db, id))).await
    }

    async fn list_deliveries(
        &self,
        project: &str,
        filter: DeliveryFilter,
        before: Option<(i64, DeliveryId)>,
        limit: u32,
    ) -> Result<Vec<DeliveryRow>> {
        let project = project.to_owned();
        self.read(with!([project] db => list_deliveries(db, &project, filter, before, limit)))
            .await
    }

    async fn redeliver(&self, id: DeliveryId, now: i64) -> Result<DeliveryRow> {
        self.change(with!([] db => redeliver(db, id, now))).await
    }

    async fn claim_delivery(&self, busy: &Busy, lease: Duration, now: i64) -> Result<Option<Sending>> {
        deliveries::claim(self, busy, lease, now).await
    }

    async fn keep_delivery_body(&self, id: DeliveryId, token: &str, body: &[u8]) -> Result<bool> {
        let (token, body) = (token::hash(token), body.to_vec());
        self.change(with!([token, body] db => keep_body(db, id, &token, &body)))
            .await
    }

    async fn delivered(&self, id: DeliveryId, token: &str, now: i64) -> Result<bool> {
        let token = token::hash(token);
        self.change(with!([token] db => delivered(db, id, &token, now))).await
    }

    async fn not_delivered(
        &self,
        id: DeliveryId,
        token: &str,
        error: &str,
        next: Option<i64>,
        now: i64,
    ) -> Result<bool> {
        let (token, error) = (token::hash(token), storable(error));
        self.change(with!([token, error] db => not_delivered(db, id, &token, &error, next, now)))
            .await
    }

    async fn forget_deliveries(&self, older_than: i64, limit: u32) -> Result<u64> {
        self.change(with!([] db => forget(db, older_than, limit))).await
    }
}

/// Makes a delivery for every hook that wants to know of a job that is over; in the transaction that ends it. The hooks
/// stay until it ends: one that was deleted meanwhile would have the job's end refused.
pub(super) async fn announce(db: &mut DbConnection, job: &JobRow, now: i64) -> Result<()> {
    let wanting = sqlx::query_scalar(concat!(
        "SELECT id FROM hooks WHERE project = $1 AND (kinds = 0 OR kinds & $2 <> 0) AND (states = 0 OR states & $3 <> 0)",
        for_key_share!()
    ));
    let wanting: Vec<Uuid> = wanting
        .bind(&job.project)
        .bind(kind_bit(job.kind()))
        .bind(state_bit(job.state))
        .fetch_all(&mut *db)
        .await?;
    if wanting.is_empty() {
        return Ok(());
    }
    let waiting: i64 = sqlx::query_scalar(WAITING)
        .bind(&job.project)
        .bind(MOST_WAITING)
        .fetch_one(&mut *db)
        .await?;
    let full = waiting >= MOST_WAITING;
    for hook in wanting {
        let insert = sqlx::query(
            "INSERT INTO deliveries (id, hook_id, project, job_id, job_state, create_time, since, next_time, state, \
             last_error, end_time) VALUES ($1, $2, $3, $4, $5, $6, $6, $6, $7, $8, $9)",
        );
        insert
            .bind(Uuid::now_v7())
            .bind(hook)
            .bind(&job.project)
            .bind(job.id)
            .bind(job.state as i32)
            .bind(now)
            .bind(if full {
                DeliveryState::Dead
            } else {
                DeliveryState::Pending
            } as i32)
            .bind(if full { TOO_MANY } else { "" })
            .bind(full.then_some(now))
            .execute(&mut *db)
            .await?;
    }
    Ok(())
}

/// Keeps what is sent, if nothing was kept before.
async fn keep_body(db: &mut DbConnection, id: DeliveryId, token: &[u8], body: &[u8]) -> Result<bool> {
    let update = sqlx::query("UPDATE deliveries SET body = coalesce(body, $3) WHERE id = $1 AND lease_token = $2");
    let update = update.bind(id).bind(token).bind(body);
    Ok(update.execute(db).await?.rows_affected() > 0)
}

async fn create(db: &mut DbConnection, new: &NewHook, now: i64) -> Result<HookRow> {
    let (kinds, states) = new.topics.bits();
    let insert = sqlx::query(
        "INSERT INTO hooks (id, project, display_name, url, kinds, states, sealed_secret, create_time) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8) RETURNING *",
    );
    let row = insert
        .bind(new.id)
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

async fn get(db: &mut DbConnection, id: HookId) -> Result<Option<HookRow>> {
    let query = sqlx::query("SELECT * FROM hooks WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(hook).transpose()
}

async fn list(db: &mut DbConnection, project: &str, before: Option<(i64, HookId)>, limit: u32) -> Result<Vec<HookRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let query = sqlx::query(HOOKS)
        .bind(time)
        .bind(id)
        .bind(i64::from(limit))
        .bind(project);
    query.fetch_all(db).await?.iter().map(hook).collect()
}

async fn delete(db: &mut DbConnection, id: HookId) -> Result<()> {
    let query = sqlx::query("DELETE FROM hooks WHERE id = $1").bind(id);
    match query.execute(db).await?.rows_affected() {
        0 => Err(LedgerError::NotFound { kind: "hook", id }),
        _ => Ok(()),
    }
}

async fn get_delivery(db: &mut DbConnection, id: DeliveryId) -> Result<Option<DeliveryRow>> {
    let query = sqlx::query("SELECT * FROM deliveries WHERE id = $1").bind(id);
    query.fetch_optional(db).await?.as_ref().map(delivery).transpose()
}

async fn list_deliveries(
    db: &mut DbConnection,
    project: &str,
    filter: DeliveryFilter,
    before: Option<(i64, DeliveryId)>,
    limit: u32,
) -> Result<Vec<DeliveryRow>> {
    let (time, id) = before.unwrap_or((i64::MAX, Uuid::max()));
    let page = sqlx::query(if filter.hook.is_some() { OF_HOOK } else { OF_PROJECT });
    let page = page.bind(time).bind(id).bind(i64::from(limit));
    let page = match filter.hook {
        Some(hook) => page.bind(hook),
        None => page.bind(project),
    };
    let query = page.bind(filter.state.map(|state| state as i32));
    query.fetch_all(db).await?.iter().map(delivery).collect()
}

async fn redeliver(db: &mut DbConnection, id: DeliveryId, now: i64) -> Result<DeliveryRow> {
    let update = sqlx::query(
        "UPDATE deliveries SET state = 1, attempts = 0, since = $2, next_time = $2, end_time = NULL, lease_token = NULL \
         WHERE id = $1 AND NOT (lease_token IS NOT NULL AND next_time > $2)",
    );
    update.bind(id).bind(now).execute(&mut *db).await?;
    let found = get_delivery(db, id).await?;
    found.ok_or(LedgerError::NotFound { kind: "delivery", id })
}

async fn delivered(db: &mut DbConnection, id: DeliveryId, token: &[u8], now: i64) -> Result<bool> {
    let update = sqlx::query(
        "UPDATE deliveries SET state = 2, last_error = '', lease_token = NULL, end_time = $3 \
         WHERE id = $1 AND lease_token = $2",
    );
    let update = update.bind(id).bind(token).bind(now);
    Ok(update.execute(db).await?.rows_affected() > 0)
}

async fn not_delivered(
    db: &mut DbConnection,
    id: DeliveryId,
    token: &[u8],
    error: &str,
    next: Option<i64>,
    now: i64,
) -> Result<bool> {
    let update = sqlx::query(
        "UPDATE deliveries SET state = CASE WHEN CAST($4 AS bigint) IS NULL THEN 3 ELSE 1 END, \
         next_time = coalesce($4, next_time), \
         end_time = CASE WHEN CAST($4 AS bigint) IS NULL THEN CAST($5 AS bigint) END, \
         last_error = $3, lease_token = NULL WHERE id = $1 AND lease_token = $2",
    );
    let update = update.bind(id).bind(token).bind(error).bind(next).bind(now);
    Ok(update.execute(db).await?.rows_affected() > 0)
}

async fn forget(db: &mut DbConnection, older_than: i64, limit: u32) -> Result<u64> {
    let delete = sqlx::query(concat!(
        "DELETE FROM deliveries WHERE id IN (SELECT id FROM deliveries WHERE state > 1 AND end_time < $1 LIMIT $2",
        skip_locked!(),
        ")"
    ));
    let delete = delete.bind(older_than).bind(i64::from(limit));
    Ok(delete.execute(db).await?.rows_affected())
}

fn hook(row: &DbRow) -> Result<HookRow> {
    Ok(HookRow {
        id: row.try_get("id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        url: row.try_get("url")?,
        topics: Topics::from_bits(rows::number(row, "kinds")?, rows::number(row, "states")?)?,
        sealed_secret: row.try_get("sealed_secret")?,
        create_time: row.try_get("create_time")?,
    })
}

fn delivery(row: &DbRow) -> Result<DeliveryRow> {
    Ok(DeliveryRow {
        id: row.try_get("id")?,
        hook: row.try_get("hook_id")?,
        project: row.try_get("project")?,
        job: row.try_get("job_id")?,
        job_state: discriminants::job_state(rows::number(row, "job_state")?)?,
        state: DeliveryState::of_number(rows::number(row, "state")?)?,
        attempts: row.try_get("attempts")?,
        last_error: row.try_get("last_error")?,
        create_time: row.try_get("create_time")?,
        since: row.try_get("since")?,
        next_time: row.try_get("next_time")?,
        last_time: row.try_get("last_time")?,
        end_time: row.try_get("end_time")?,
    })
}

/// The right to the attempt at a delivery that was just counted.
pub(super) async fn sending(db: &mut DbConnection, row: &DbRow, token: String) -> Result<Sending> {
    let delivery = delivery(row)?;
    let hook = get(db, delivery.hook).await?.ok_or(LedgerError::NotFound {
        kind: "hook",
        id: delivery.hook,
    })?;
    let job = sqlx::query("SELECT * FROM jobs WHERE id = $1").bind(delivery.job);
    let job = job.fetch_optional(db).await?;
    let asked_id = match &job {
        Some(row) => row
            .try_get::<Option<Uuid>, _>("asked_id")?
            .or(row.try_get("request_id")?),
        None => None,
    };
    Ok(Sending {
        delivery,
        hook,
        job: job.as_ref().map(rows::job).transpose()?,
        asked_id,
        body: row.try_get("body")?,
        token,
    })
}
