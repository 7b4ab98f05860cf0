//! Opening the database: where it is, how its connections are set up, and the layout of its tables.
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use secrecy::{ExposeSecret, SecretString};
use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{Connection, Executor, PgConnection, PgPool, SqlSafeStr};
use tokio::time::{Instant, sleep, timeout};
use uuid::Uuid;

use super::super::{LedgerError, Result};
use super::errors::{self, ErrorClass};

/// Most connections of a server, besides the one that listens.
const CONNECTIONS: u32 = 16;
/// How long a call waits for a connection, whether all are in use or the database is away.
const ACQUIRE: Duration = Duration::from_secs(3);
/// How long a server that begins waits for a database that is not there yet.
const START: Duration = Duration::from_secs(30);
/// How long one try to connect may take.
const CONNECT: Duration = Duration::from_secs(10);
/// How far the clocks of server and database may be apart without a word.
const CLOCKS_APART: Duration = Duration::from_secs(2);

/// What the ledger relies on, said for each connection: limits that end what hangs, so that a server that is stopped
/// amid a transaction holds up the others for seconds only; locks of rows that see what was committed while they waited;
/// and commits that are on disk, also where somebody's default is another.
const SESSION: &str = "SET statement_timeout = '6s'; SET lock_timeout = '5s'; \
    SET idle_in_transaction_session_timeout = '10s'; \
    SET default_transaction_isolation = 'read committed'; \
    SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'";

/// Parameters that a URL may have; sqlx would write the others into the log, with their values.
const PARAMETERS: [&str; 17] = [
    "application_name",
    "dbname",
    "host",
    "hostaddr",
    "options",
    "password",
    "port",
    "ssl-ca",
    "ssl-cert",
    "ssl-key",
    "ssl-mode",
    "ssl-root-cert",
    "sslcert",
    "sslkey",
    "sslmode",
    "sslrootcert",
    "user",
];

/// Whether a ledger may be at this URL; if not, why, without the URL.
pub(super) fn check_url(url: &SecretString) -> std::result::Result<(), String> {
    let text = url.expose_secret();
    if !text.starts_with("postgres://") && !text.starts_with("postgresql://") {
        return Err("is no URL of the form postgres://USER:PASSWORD@HOST:PORT/DATABASE".into());
    }
    let query = text.split_once('?').map(|(_, query)| query).unwrap_or_default();
    for pair in query.split('&').filter(|pair| !pair.is_empty()) {
        let name = pair.split('=').next().unwrap_or_default();
        if !PARAMETERS.contains(&name) && !name.starts_with("options[") {
            // Not by its name, which is a part of the password where a ? in that was not written as %3f.
            return Err(format!(
                "has a parameter that is not known; known are {}",
                PARAMETERS.join(", ")
            ));
        }
    }
    // What is wrong is not repeated, for it may be a part of the password.
    match PgConnectOptions::from_str(text) {
        Ok(_) => Ok(()),
        Err(_) => Err("can't be read as postgres://USER:PASSWORD@HOST:PORT/DATABASE; \
                       characters such as @ : / ? # in a password are written as %40 and so on"
            .into()),
    }
}

/// Where the database is, from its URL.
///
/// # Errors
/// `Database` when it can't be read; its text may hold parts of the URL. [`check_url`] says it without.
pub(super) fn options(url: &SecretString) -> Result<PgConnectOptions> {
    let options = PgConnectOptions::from_str(url.expose_secret())?;
    Ok(match options.get_application_name() {
        Some(_) => options,
        None => options.application_name("guardsplat-server"),
    })
}

/// Waits for the database, and brings its tables to this version's layout. Of several servers that begin at once one
/// does so, and the others wait.
pub(super) async fn migrated(options: &PgConnectOptions) -> Result<()> {
    let begun = Instant::now();
    let mut db = loop {
        let tried = timeout(CONNECT, PgConnection::connect_with(options)).await;
        let error = match tried {
            Ok(Ok(db)) => break db,
            Ok(Err(error)) if errors::classify(&error) == ErrorClass::Broken => LedgerError::from(error),
            Ok(Err(error)) => return Err(error.into()),
            Err(_) => errors::no_answer(CONNECT),
        };
        if begun.elapsed() >= START {
            return Err(errors::to_ledger_error(error));
        }
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        tracing::warn!(cause, "the ledger's database can't be reached; trying again");
        sleep(Duration::from_secs(1)).await;
    };
    // `run` would do the same, but its future can't be seen to move between threads.
    Migrator::with_migrations(steps())
        .run_direct(None, &mut db, false)
        .await?;
    compare_clocks(&mut db).await?;
    // What matters is done.
    let _ = db.close().await;
    Ok(())
}

/// Leases are given out by the clock of one server and ended by that of another, so they must agree. Each is compared
/// with the database's.
async fn compare_clocks(db: &mut PgConnection) -> Result<()> {
    let theirs: i64 = sqlx::query_scalar("SELECT (extract(epoch FROM clock_timestamp()) * 1000000)::bigint")
        .fetch_one(db)
        .await?;
    let ours = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let apart = ours.abs_diff(Duration::from_micros(u64::try_from(theirs).unwrap_or_default()));
    if apart > CLOCKS_APART {
        tracing::warn!(
            ?apart,
            "the clocks of this machine and the database's differ; several servers need clocks that agree"
        );
    }
    Ok(())
}

/// Connections for calls, made when they are needed. `server` is what this server's changes are announced under.
pub(super) fn pool(options: PgConnectOptions, server: Uuid) -> PgPool {
    PgPoolOptions::new()
        .max_connections(CONNECTIONS)
        .acquire_timeout(ACQUIRE)
        .after_connect(move |db, _| {
            Box::pin(async move {
                (&mut *db).execute(SESSION).await?;
                sqlx::query("SELECT set_config('guardsplat.server', $1, false)")
                    .bind(server.to_string())
                    .execute(db)
                    .await?;
                Ok(())
            })
        })
        .connect_lazy_with(options)
}

/// The steps from a database without tables to this version's.
pub(super) fn steps() -> Vec<Migration> {
    let step = |version, name: &'static str, script: &'static str| {
        Migration::new(
            version,
            name.into(),
            MigrationType::Simple,
            script.into_sql_str(),
            false,
        )
    };
    vec![
        step(
            1,
            "ledger",
            include_str!("../../../migrations/postgres/0001_ledger.sql"),
        ),
        step(
            2,
            "tokens",
            include_str!("../../../migrations/postgres/0002_tokens.sql"),
        ),
        step(
            3,
            "projects",
            include_str!("../../../migrations/postgres/0003_projects.sql"),
        ),
        step(
            4,
            "retention",
            include_str!("../../../migrations/postgres/0004_retention.sql"),
        ),
        step(5, "hooks", include_str!("../../../migrations/postgres/0005_hooks.sql")),
        step(
            6,
            "operations",
            include_str!("../../../migrations/postgres/0006_operations.sql"),
        ),
        step(7, "queue", include_str!("../../../migrations/postgres/0007_queue.sql")),
        step(
            8,
            "claims",
            include_str!("../../../migrations/postgres/0008_claims.sql"),
        ),
        step(
            9,
            "upload reservations",
            include_str!("../../../migrations/postgres/0009_upload_reservations.sql"),
        ),
        step(
            10,
            "hardening",
            include_str!("../../../migrations/postgres/0010_hardening.sql"),
        ),
        step(
            11,
            "workers",
            include_str!("../../../migrations/postgres/0011_workers.sql"),
        ),
        step(
            12,
            "credentials",
            include_str!("../../../migrations/postgres/0012_credentials.sql"),
        ),
    ]
}
