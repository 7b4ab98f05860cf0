//! What goes by age.
use std::collections::HashSet;

use sqlx::SqliteConnection;

use super::super::Result;
use super::super::retention::sqlite::{OVER, UNUSED, UPLOAD};
use super::super::retention::{Before, Expired, LEFT_NOTHING, Retention, WITHOUT_OUTPUTS};
use super::super::types::ArtifactId;
use super::SqliteLedger;

#[async_trait::async_trait]
impl Retention for SqliteLedger {
    async fn expire(&self, before: Before, limit: u32) -> Result<Expired> {
        self.writer.run(move |db| Box::pin(expire(db, before, limit))).await
    }

    async fn known_paths(&self, ids: &[ArtifactId]) -> Result<HashSet<String>> {
        let mut reader = self.readers.acquire().await?;
        let mut known = HashSet::new();
        for id in ids {
            let path = sqlx::query_scalar("SELECT path FROM artifacts WHERE id = $1").bind(id);
            known.extend(path.fetch_optional(&mut *reader).await?);
        }
        Ok(known)
    }
}

async fn expire(db: &mut SqliteConnection, before: Before, limit: u32) -> Result<Expired> {
    let mut expired = Expired::default();
    if let Some(time) = before.uploads {
        let which = format!("SELECT a.id FROM artifacts a WHERE {UPLOAD} AND {UNUSED} LIMIT $2");
        expired.artifacts += delete(db, &which, time, limit).await?;
    }
    if let Some(time) = before.outputs {
        let of_jobs = format!("FROM artifacts a JOIN jobs j ON j.id = a.job_id WHERE {OVER} AND {UNUSED}");
        expired.artifacts += delete(db, &format!("SELECT a.id {of_jobs} LIMIT $2"), time, limit).await?;
    }
    if let Some(time) = before.jobs {
        let of_jobs =
            format!("FROM artifacts a JOIN jobs j ON j.id = a.job_id WHERE {OVER} AND {LEFT_NOTHING} AND {UNUSED}");
        expired.artifacts += delete(db, &format!("SELECT a.id {of_jobs} LIMIT $2"), time, limit).await?;
        let gone = format!(
            "DELETE FROM jobs WHERE id IN (\
             SELECT j.id FROM jobs j WHERE {OVER} AND {LEFT_NOTHING} AND {WITHOUT_OUTPUTS} LIMIT $2)"
        );
        let gone = sqlx::query(sqlx::AssertSqlSafe(gone)).bind(time).bind(limit);
        expired.jobs = gone.execute(db).await?.rows_affected();
    }
    Ok(expired)
}

/// Marks artifacts as deleted; `which` is one of the selections above.
async fn delete(db: &mut SqliteConnection, which: &str, time: i64, limit: u32) -> Result<u64> {
    let statement = format!("UPDATE artifacts SET state = 4 WHERE id IN ({which})");
    let marked = sqlx::query(sqlx::AssertSqlSafe(statement)).bind(time).bind(limit);
    Ok(marked.execute(db).await?.rows_affected())
}
