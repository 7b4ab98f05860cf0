//! The row of the store's generation.
use sqlx::Row;
use uuid::Uuid;

use super::super::{Generation, GenerationLedger, Result};
use super::{DbConnection, DbLedger};

#[async_trait::async_trait]
impl GenerationLedger for DbLedger {
    async fn generation(&self) -> Result<Option<Generation>> {
        self.read(with!([] db => generation(db))).await
    }

    async fn advance_generation(&self, from: Option<Uuid>, next: Uuid, now: i64) -> Result<Generation> {
        self.change(with!([] db => advance(db, from, next, now))).await
    }
}

async fn generation(db: &mut DbConnection) -> Result<Option<Generation>> {
    let row = sqlx::query("SELECT * FROM store_generation").fetch_optional(db).await?;
    row.map(|row| {
        Ok(Generation {
            current: row.try_get("current")?,
            previous: row.try_get("previous")?,
            time: row.try_get("time")?,
        })
    })
    .transpose()
}

async fn advance(db: &mut DbConnection, from: Option<Uuid>, next: Uuid, now: i64) -> Result<Generation> {
    let change = match from {
        None => {
            sqlx::query("INSERT INTO store_generation (id, current, time) VALUES (1, $1, $2) ON CONFLICT DO NOTHING")
        }
        Some(_) => {
            sqlx::query("UPDATE store_generation SET previous = current, current = $1, time = $2 WHERE current = $3")
        }
    };
    let change = change.bind(next).bind(now);
    match from {
        None => change.execute(&mut *db).await?,
        Some(from) => change.bind(from).execute(&mut *db).await?,
    };
    generation(db).await?.ok_or_else(|| sqlx::Error::RowNotFound.into())
}
