//! Calls to the database: each in a bounded time, again where nothing was done and that can help.
use std::time::Duration;

use futures::future::BoxFuture;
use sqlx::pool::PoolConnection;
use sqlx::{Connection, PgConnection, PgPool, Postgres};
use tokio::time::{sleep, timeout};

use super::super::{LedgerError, Result};
use super::errors::{self, ErrorClass};

/// How often a call is tried.
const TRIES: u32 = 4;
/// How long to wait before the first repetition; then twice as long, and so on.
const PAUSE: Duration = Duration::from_millis(50);
/// How long one try may take once it has a connection. Statements have a shorter limit of their own, so this is for a
/// database that is silent.
const SILENCE: Duration = Duration::from_secs(12);

/// A pool of connections, and how they are used.
#[derive(Clone)]
pub(super) struct Database {
    pool: PgPool,
}

/// What a call does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Read,
    Change,
}

/// What came of a try.
type Tried<T> = std::result::Result<T, Failed>;

/// Why a try came to nothing.
struct Failed {
    error: LedgerError,
    /// Nothing was changed for certain.
    undone: bool,
}

impl Failed {
    fn undone(error: impl Into<LedgerError>) -> Self {
        Self {
            error: error.into(),
            undone: true,
        }
    }

    /// Whether another try may do better.
    fn passes(&self) -> bool {
        let class = match &self.error {
            LedgerError::Database(error) => errors::classify(error),
            _ => ErrorClass::Other,
        };
        self.undone && matches!(class, ErrorClass::Broken | ErrorClass::Conflict)
    }
}

impl Database {
    pub(super) fn new(pool: PgPool) -> Self {
        Self { pool }
    }

    pub(super) async fn close(&self) {
        self.pool.close().await;
    }

    /// Reads. `work` may be carried out several times.
    pub(super) async fn read<T, F>(&self, work: F) -> Result<T>
    where
        T: Send,
        F: for<'c> Fn(&'c mut PgConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
    {
        self.call(Kind::Read, work).await
    }

    /// Makes a change in a transaction of its own, and returns when it is durable, or wasn't made. `work` may be carried
    /// out several times, and counts once.
    ///
    /// # Errors
    /// Those of `work`; `Unavailable`, after which the change may have been made nevertheless: the answer to the last
    /// word of a transaction can be lost.
    pub(super) async fn change<T, F>(&self, work: F) -> Result<T>
    where
        T: Send,
        F: for<'c> Fn(&'c mut PgConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
    {
        self.call(Kind::Change, work).await
    }

    async fn call<T, F>(&self, kind: Kind, work: F) -> Result<T>
    where
        T: Send,
        F: for<'c> Fn(&'c mut PgConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
    {
        let mut tried = 1;
        loop {
            let failed = match self.try_once(kind, &work).await {
                Ok(value) => return Ok(value),
                Err(failed) => failed,
            };
            if tried == TRIES || !failed.passes() {
                return Err(errors::to_ledger_error(failed.error));
            }
            sleep(PAUSE * 2_u32.pow(tried - 1)).await;
            tried += 1;
        }
    }

    async fn try_once<T, F>(&self, kind: Kind, work: &F) -> Tried<T>
    where
        T: Send,
        F: for<'c> Fn(&'c mut PgConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
    {
        // The pool tries for as long as it may.
        let connection = self.pool.acquire().await.map_err(Failed::undone)?;
        let mut held = Held {
            connection,
            finished: false,
        };
        let said = timeout(SILENCE, converse(&mut held.connection, kind, work)).await;
        let Ok(outcome) = said else {
            return Err(Failed {
                error: errors::no_answer(SILENCE),
                undone: false,
            });
        };
        held.finished = true;
        outcome
    }
}

async fn converse<T, F>(db: &mut PgConnection, kind: Kind, work: &F) -> Tried<T>
where
    T: Send,
    F: for<'c> Fn(&'c mut PgConnection) -> BoxFuture<'c, Result<T>> + Send + Sync,
{
    if kind == Kind::Read {
        return work(db).await.map_err(Failed::undone);
    }
    let mut transaction = db.begin().await.map_err(Failed::undone)?;
    match work(&mut transaction).await {
        Ok(value) => match transaction.commit().await {
            Ok(()) => Ok(value),
            Err(error) => Err(Failed {
                // The database says so itself, if the change was refused at the end; nothing else is known.
                undone: matches!(errors::classify(&error), ErrorClass::Conflict),
                error: error.into(),
            }),
        },
        Err(error) => {
            // Locks go before the answer does. An error here is that of a connection that is gone, and they with it.
            let _ = transaction.rollback().await;
            Err(Failed::undone(error))
        }
    }
}

/// A connection in use. One that is dropped amid a conversation, because the caller went away or nothing was answered,
/// is closed: the pool would wait for the rest of the answer, for as long as the network takes to notice.
struct Held {
    connection: PoolConnection<Postgres>,
    finished: bool,
}

impl Drop for Held {
    fn drop(&mut self) {
        if !self.finished {
            self.connection.close_on_drop();
        }
    }
}
