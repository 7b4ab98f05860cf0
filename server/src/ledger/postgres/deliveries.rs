//! Which delivery is sent next.
use std::time::Duration;

use sqlx::PgConnection;

use super::super::hooks::{Busy, Sending};
use super::super::transition::end_of;
use super::super::{Result, token};
use super::{PostgresLedger, hooks};

/// Takes the delivery that has been due for longest and that nobody else is taking.
pub(super) const CLAIM: &str = "WITH next AS MATERIALIZED (\
        SELECT id AS next_id FROM deliveries WHERE state = 1 AND next_time <= $1 AND hook_id <> ALL($2) \
        AND project <> ALL($5) \
        ORDER BY next_time, id LIMIT 1 FOR UPDATE SKIP LOCKED) \
    UPDATE deliveries SET attempts = attempts + 1, lease_token = $3, next_time = $4, last_time = $1 \
    FROM next WHERE id = next_id RETURNING *";

/// Gives out the delivery that has been due for longest.
pub(super) async fn claim(ledger: &PostgresLedger, busy: &Busy, lease: Duration, now: i64) -> Result<Option<Sending>> {
    let busy = busy.clone();
    ledger.change(with!([busy] db => take(db, &busy, lease, now))).await
}

async fn take(db: &mut PgConnection, busy: &Busy, lease: Duration, now: i64) -> Result<Option<Sending>> {
    let token = token::fresh();
    let row = sqlx::query(CLAIM)
        .bind(now)
        .bind(&busy.hooks)
        .bind(token::hash(&token))
        .bind(end_of(lease, now))
        .bind(&busy.projects)
        .fetch_optional(&mut *db)
        .await?;
    let Some(row) = row else { return Ok(None) };
    hooks::sending(db, &row, token).await.map(Some)
}
