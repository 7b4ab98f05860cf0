//! The ledger in a PostgreSQL database, which several servers may share.
//!
//! Every change is one transaction, which locks the rows that it decides by: the job whose lease it checks, the inputs
//! of a new job, the chain of commitments. What a server changes the others hear of from the database.
//!
//! What SQLite does just so is in [`shared`](super::shared).
#![allow(
    clippy::duplicate_mod,
    reason = "files of `shared` are a part of each database's module"
)]

/// Ends a selection that locks its rows, for whoever is going to change them.
macro_rules! for_update {
    () => {
        " FOR UPDATE"
    };
}
/// Ends a selection whose rows nobody changes until the transaction ends.
macro_rules! for_share {
    () => {
        " FOR SHARE"
    };
}
/// Ends a selection whose rows nobody removes until the transaction ends.
macro_rules! for_key_share {
    () => {
        " FOR KEY SHARE"
    };
}
/// Ends a selection that locks the rows of one table, and leaves out those that somebody else has locked.
macro_rules! skip_locked {
    () => {
        " FOR UPDATE SKIP LOCKED"
    };
    ($table:literal) => {
        concat!(" FOR UPDATE OF ", $table, " SKIP LOCKED")
    };
}
/// Names an index to a planner that would choose another; this one chooses well.
macro_rules! indexed_by {
    ($index:literal) => {
        ""
    };
}
/// The larger of two values.
macro_rules! greatest {
    ($a:literal, $b:literal) => {
        concat!("greatest(", $a, ", ", $b, ")")
    };
}
/// The sum of bytes of a selection, of which there may be none. It is one without limits.
macro_rules! total {
    ($value:literal) => {
        concat!("least(coalesce(sum(", $value, "), 0), 9223372036854775807)::bigint")
    };
}
/// A join that reads its left side in order; this planner finds the order by itself.
macro_rules! in_order_join {
    () => {
        " JOIN "
    };
}

mod database;
mod deliveries;
mod errors;
mod inputs;
mod notices;
mod open;
mod presence;
mod queue;
mod retention;
#[cfg(test)]
pub(crate) mod tests;

#[path = "../shared/artifacts.rs"]
mod artifacts;
#[path = "../shared/commitments.rs"]
mod commitments;
#[path = "../shared/credentials.rs"]
mod credentials;
#[path = "../shared/generation.rs"]
mod generation;
#[path = "../shared/history.rs"]
mod history;
#[path = "../shared/hooks.rs"]
mod hooks;
#[path = "../shared/jobs.rs"]
mod jobs;
#[path = "../shared/keys.rs"]
mod keys;
#[path = "../shared/leases.rs"]
mod leases;
#[path = "../shared/registry.rs"]
mod registry;
#[path = "../shared/reservations.rs"]
mod reservations;
#[path = "../shared/retries.rs"]
mod retries;
#[path = "../shared/rows.rs"]
mod rows;
#[path = "../shared/statistics.rs"]
mod statistics;
#[path = "../shared/tokens.rs"]
mod tokens;
#[path = "../shared/transition.rs"]
mod transition;
#[path = "../shared/workers.rs"]
mod workers;

use futures::future::BoxFuture;
use secrecy::SecretString;
use sqlx::postgres::PgConnectOptions;
use tokio::sync::broadcast;
use uuid::Uuid;

use super::{Ledger, RemoteChange, Result};
use database::Database;
use notices::Notices;

/// What [`shared`](super::shared) means by these.
type DbConnection = sqlx::PgConnection;
type DbLedger = PostgresLedger;
type DbRow = sqlx::postgres::PgRow;

/// Begins a transaction that sees one moment.
const SNAPSHOT: &str = "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY";

/// A text as the database can keep it, which is without one character.
fn storable(text: &str) -> String {
    text.replace('\0', "\u{fffd}")
}

/// A ledger in a PostgreSQL database.
pub struct PostgresLedger {
    database: Database,
    notices: Notices,
}

impl PostgresLedger {
    /// Opens the ledger in the database at `url`, making or updating its tables as needed. A database that is not there
    /// yet is waited for, half a minute at most.
    ///
    /// # Errors
    /// `Unavailable` when the database can't be reached, `Database` when it refuses, `Migrate` when a newer version
    /// wrote it.
    pub async fn open(url: &SecretString) -> Result<Self> {
        Self::open_with(open::options(url)?).await
    }

    async fn open_with(options: PgConnectOptions) -> Result<Self> {
        open::migrated(&options).await?;
        // What this server is called among those that share the database, until it ends.
        let server = Uuid::now_v7();
        Ok(Self {
            database: Database::new(open::pool(options.clone(), server)),
            notices: Notices::start(options, server),
        })
    }

    /// Reads; `work` may be carried out several times.
    async fn read<T, F>(&self, work: F) -> Result<T>
    where
        T: Send,
        F: for<'c> Fn(&'c mut DbConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
    {
        self.database.read(work).await
    }

    /// Makes a change, durable when this returns; `work` may be carried out several times, and counts once.
    async fn change<T, F>(&self, work: F) -> Result<T>
    where
        T: Send,
        F: for<'c> Fn(&'c mut DbConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
    {
        self.database.change(work).await
    }
}

/// Whether something is the URL of a database that a ledger may be in; if not, why. The answer names no part of it but
/// parameters, as it may hold a password.
///
/// # Errors
/// A text that says what is wrong with it.
pub fn check_url(url: &SecretString) -> std::result::Result<(), String> {
    open::check_url(url)
}

#[async_trait::async_trait]
impl Ledger for PostgresLedger {
    async fn check(&self) -> Result<()> {
        self.read(with!([] db => presence::check(db))).await
    }

    fn is_shared(&self) -> bool {
        true
    }

    fn remote_changes(&self) -> Option<broadcast::Receiver<RemoteChange>> {
        Some(self.notices.subscribe())
    }

    async fn close(&self) {
        self.notices.stop();
        self.database.close().await;
    }
}
