//! What goes by age. Rows are locked first and looked at again then: a job that is being made holds its inputs, and is
//! there to need them when they are free.
use std::collections::HashSet;

use sqlx::PgConnection;
use uuid::Uuid;

use super::super::Result;
use super::super::retention::postgres::{OVER, UNUSED, UPLOAD};
use super::super::retention::{Before, Expired, LEFT_NOTHING, Retention, WITHOUT_OUTPUTS};
use super::super::types::ArtifactId;
use super::PostgresLedger;

#[async_trait::async_trait]
impl Retention for PostgresLedger {
    async fn expire(&self, before: Before, limit: u32) -> Result<Expired> {
        self.database.change(with!([] db => expire(db, before, limit))).await
    }

    async fn known_paths(&self, ids: &[ArtifactId]) -> Result<HashSet<String>> {
        let ids = ids.to_vec();
        self.database.read(with!([ids] db => known_paths(db, ids))).await
    }
}

async fn known_paths(db: &mut PgConnection, ids: Vec<ArtifactId>) -> Result<HashSet<String>> {
    let paths = sqlx::query_scalar("SELECT path FROM artifacts WHERE id = ANY($1)").bind(ids);
    Ok(paths.fetch_all(db).await?.into_iter().collect())
}

async fn expire(db: &mut PgConnection, before: Before, limit: u32) -> Result<Expired> {
    let mut expired = Expired::default();
    if let Some(time) = before.uploads {
        let which = format!("FROM artifacts a WHERE {UPLOAD} AND {UNUSED}");
        expired.artifacts += delete(db, &which, time, limit).await?;
    }
    if let Some(time) = before.outputs {
        let which = format!("FROM artifacts a JOIN jobs j ON j.id = a.job_id WHERE {OVER} AND {UNUSED}");
        expired.artifacts += delete(db, &which, time, limit).await?;
    }
    if let Some(time) = before.jobs {
        let which =
            format!("FROM artifacts a JOIN jobs j ON j.id = a.job_id WHERE {OVER} AND {LEFT_NOTHING} AND {UNUSED}");
        expired.artifacts += delete(db, &which, time, limit).await?;
        let which = format!("FROM jobs j WHERE {OVER} AND {LEFT_NOTHING} AND {WITHOUT_OUTPUTS}");
        let held = hold(db, "j", &which, time, limit).await?;
        let gone = format!("DELETE FROM jobs WHERE id IN (SELECT j.id {which} AND j.id = ANY($2))");
        let gone = sqlx::query(sqlx::AssertSqlSafe(gone)).bind(time).bind(held);
        expired.jobs = gone.execute(db).await?.rows_affected();
    }
    Ok(expired)
}

/// Marks artifacts as deleted; `which` is one of the selections above.
async fn delete(db: &mut PgConnection, which: &str, time: i64, limit: u32) -> Result<u64> {
    let held = hold(db, "a", which, time, limit).await?;
    let statement = format!("UPDATE artifacts SET state = 4 WHERE id IN (SELECT a.id {which} AND a.id = ANY($2))");
    let marked = sqlx::query(sqlx::AssertSqlSafe(statement)).bind(time).bind(held);
    Ok(marked.execute(db).await?.rows_affected())
}

/// Locks what seems to go; what somebody else holds is left for the next time.
async fn hold(db: &mut PgConnection, of: &str, which: &str, time: i64, limit: u32) -> Result<Vec<Uuid>> {
    let statement = format!("SELECT {of}.id {which} LIMIT $2 FOR UPDATE OF {of} SKIP LOCKED");
    let held = sqlx::query_scalar(sqlx::AssertSqlSafe(statement));
    Ok(held.bind(time).bind(i64::from(limit)).fetch_all(db).await?)
}
