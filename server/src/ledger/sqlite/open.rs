//! Opening the file: durability, locking, and the layout of its tables.
use std::path::Path;
use std::time::Duration;

use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Connection, SqlSafeStr, SqliteConnection, SqlitePool};

use super::super::Result;

/// How long a connection waits for another process (a backup, a person with a shell) to let go of the file.
pub(super) const BUSY: Duration = Duration::from_secs(10);

/// Connections that only read.
const READERS: u32 = 4;

pub(super) fn options(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        // WAL with `NORMAL` may lose the last commits when the power goes; an acknowledged job must not.
        .synchronous(SqliteSynchronous::Full)
        .busy_timeout(BUSY)
        .foreign_keys(true)
        // What is changed or deleted is overwritten, so that a secret which lay here open does not lie on when it was sealed.
        .pragma("secure_delete", "ON")
}

pub(super) async fn connect(options: &SqliteConnectOptions) -> Result<SqliteConnection> {
    Ok(SqliteConnection::connect_with(options).await?)
}

/// The first connection, after bringing the tables to this version's layout.
pub(super) async fn migrated(options: &SqliteConnectOptions) -> Result<SqliteConnection> {
    let mut db = connect(options).await?;
    // `run` would do the same, but its future can't be seen to move between threads.
    migrator().run_direct(None, &mut db, false).await?;
    Ok(db)
}

pub(super) fn readers(options: &SqliteConnectOptions) -> SqlitePool {
    SqlitePoolOptions::new()
        .max_connections(READERS)
        .test_before_acquire(false)
        .connect_lazy_with(options.clone().create_if_missing(false).pragma("query_only", "1"))
}

fn migrator() -> Migrator {
    let step = |version, name: &'static str, layout: &'static str| {
        Migration::new(
            version,
            name.into(),
            MigrationType::Simple,
            layout.into_sql_str(),
            false,
        )
    };
    Migrator::with_migrations(vec![
        step(1, "ledger", include_str!("../../../migrations/sqlite/0001_ledger.sql")),
        step(
            2,
            "completion",
            include_str!("../../../migrations/sqlite/0002_completion.sql"),
        ),
        step(
            3,
            "registry",
            include_str!("../../../migrations/sqlite/0003_registry.sql"),
        ),
        step(4, "tokens", include_str!("../../../migrations/sqlite/0004_tokens.sql")),
        step(
            5,
            "projects",
            include_str!("../../../migrations/sqlite/0005_projects.sql"),
        ),
        step(
            6,
            "retention",
            include_str!("../../../migrations/sqlite/0006_retention.sql"),
        ),
        step(7, "hooks", include_str!("../../../migrations/sqlite/0007_hooks.sql")),
        step(
            8,
            "operations",
            include_str!("../../../migrations/sqlite/0008_operations.sql"),
        ),
        step(9, "queue", include_str!("../../../migrations/sqlite/0009_queue.sql")),
        step(10, "claims", include_str!("../../../migrations/sqlite/0010_claims.sql")),
        step(
            11,
            "upload reservations",
            include_str!("../../../migrations/sqlite/0011_upload_reservations.sql"),
        ),
        step(
            12,
            "hardening",
            include_str!("../../../migrations/sqlite/0012_hardening.sql"),
        ),
        step(
            13,
            "workers",
            include_str!("../../../migrations/sqlite/0013_workers.sql"),
        ),
        step(
            14,
            "credentials",
            include_str!("../../../migrations/sqlite/0014_credentials.sql"),
        ),
    ])
}
