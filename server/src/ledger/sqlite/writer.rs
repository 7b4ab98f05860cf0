//! The only connection that writes. Changes that wait while one is being made durable are committed together.
//!
//! Making a commit durable takes milliseconds, and there is one file; changes committed one by one would queue behind
//! each other's. So each change runs in a savepoint of its own, all that are waiting share one commit, and nobody is
//! answered before it. A change that fails undoes its savepoint and harms no other.
use futures::future::BoxFuture;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};
use tokio::sync::{mpsc, oneshot};

use super::super::{LedgerError, Result};
use super::open;

/// Changes that may wait; more wait for a place.
const WAITING: usize = 1024;
/// Most changes in one commit.
const GROUP: usize = 128;

/// Hands changes to the task that makes them.
pub(super) struct Writer {
    queue: mpsc::Sender<Message>,
}

enum Message {
    Change(Box<dyn Change>),
    Close(oneshot::Sender<()>),
}

impl Writer {
    /// Starts the task, with a connection to begin with.
    pub(super) fn start(options: SqliteConnectOptions, first: SqliteConnection) -> Self {
        let (queue, waiting) = mpsc::channel(WAITING);
        tokio::spawn(serve(options, first, waiting));
        Self { queue }
    }

    /// Makes a change, and returns when it is durable, or wasn't made.
    pub(super) async fn run<T, F>(&self, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'c> FnOnce(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T>> + Send + 'static,
    {
        let (reply, outcome) = oneshot::channel();
        let call = Call {
            work: Some(work),
            outcome: None,
            reply,
        };
        self.queue
            .send(Message::Change(Box::new(call)))
            .await
            .map_err(|_| LedgerError::Closed)?;
        outcome.await.map_err(|_| LedgerError::Closed)?
    }

    /// Waits for the changes before it, then closes the connection.
    pub(super) async fn close(&self) {
        let (reply, closed) = oneshot::channel();
        if self.queue.send(Message::Close(reply)).await.is_ok() {
            // An error means that the task has ended already.
            let _ = closed.await;
        }
    }
}

/// A change whose type of answer is forgotten.
trait Change: Send {
    /// Makes the change; whether to keep it.
    fn make<'c>(&'c mut self, db: &'c mut SqliteConnection) -> BoxFuture<'c, bool>;
    /// Answers, after the commit came out as `committed`.
    fn answer(self: Box<Self>, committed: Result<()>);
}

struct Call<T, F> {
    work: Option<F>,
    outcome: Option<Result<T>>,
    reply: oneshot::Sender<Result<T>>,
}

impl<T, F> Change for Call<T, F>
where
    T: Send,
    F: for<'c> FnOnce(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T>> + Send,
{
    fn make<'c>(&'c mut self, db: &'c mut SqliteConnection) -> BoxFuture<'c, bool> {
        Box::pin(async move {
            let Some(work) = self.work.take() else { return false };
            let outcome = work(db).await;
            // Nobody waits for the answer any more: a lease given out now would be given to nobody.
            let keep = outcome.is_ok() && !self.reply.is_closed();
            self.outcome = Some(outcome);
            keep
        })
    }

    fn answer(self: Box<Self>, committed: Result<()>) {
        let Self { outcome, reply, .. } = *self;
        // The caller may have gone; that is its right.
        let _ = reply.send(committed.and_then(|()| outcome.unwrap_or(Err(LedgerError::Closed))));
    }
}

/// Commits what is waiting, again and again, until it is told to close or nobody is left who could ask.
async fn serve(options: SqliteConnectOptions, first: SqliteConnection, mut waiting: mpsc::Receiver<Message>) {
    let mut connection = Some(first);
    let mut closing = None;
    while closing.is_none() {
        let mut next = waiting.recv().await;
        if next.is_none() {
            break;
        }
        let mut group = Vec::new();
        while let Some(message) = next.take() {
            match message {
                Message::Change(change) => group.push(change),
                Message::Close(reply) => closing = Some(reply),
            }
            if group.len() < GROUP && closing.is_none() {
                next = waiting.try_recv().ok();
            }
        }
        let committed = commit(&mut connection, &options, &mut group).await;
        if let Err(error) = &committed {
            tracing::error!(
                error = error as &dyn std::error::Error,
                "changes could not be committed"
            );
            // Whatever state the connection is in, dropping it undoes the transaction.
            connection = None;
        }
        for change in group {
            change.answer(committed.clone());
        }
    }
    // Those still waiting hear that the ledger is closed.
    drop(waiting);
    if let Some(db) = connection
        && let Err(error) = db.close().await
    {
        tracing::warn!(
            error = &error as &dyn std::error::Error,
            "the ledger was not closed cleanly"
        );
    }
    if let Some(reply) = closing {
        let _ = reply.send(());
    }
}

/// Makes all changes of a group durable at once. An error means that none was made.
async fn commit(
    connection: &mut Option<SqliteConnection>,
    options: &SqliteConnectOptions,
    group: &mut [Box<dyn Change>],
) -> Result<()> {
    let db = match connection {
        Some(db) => db,
        None => connection.insert(open::connect(options).await?),
    };
    // Takes the write lock now: one that is taken later can't be waited for.
    execute(db, "BEGIN IMMEDIATE").await?;
    for change in group {
        execute(db, "SAVEPOINT change").await?;
        if !change.make(db).await {
            execute(db, "ROLLBACK TO change").await?;
        }
        execute(db, "RELEASE change").await?;
    }
    execute(db, "COMMIT").await
}

async fn execute(db: &mut SqliteConnection, statement: &'static str) -> Result<()> {
    sqlx::query(statement).execute(db).await?;
    Ok(())
}
