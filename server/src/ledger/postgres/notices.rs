//! Hears what other servers change, from the database itself (LISTEN), for as long as the ledger is open.
use std::time::Duration;

use sqlx::PgPool;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPoolOptions};
use tokio::sync::broadcast;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::super::{RemoteChange, Result};
use super::errors;

/// What the trigger on jobs announces on.
const CHANNEL: &str = "guardsplat_jobs";
/// Changes that somebody may be late by; one that is later still is told so.
const KEPT: usize = 1024;
/// The first pause before a connection that was lost is made again; it doubles from there.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// The longest.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// After so much silence the connection is tried: one that is cut off is silent too.
const SILENCE: Duration = Duration::from_secs(30);
/// How long anything may take to be answered.
const ANSWER: Duration = Duration::from_secs(10);

/// The task that listens, and those who hear of it. It ends with this.
pub(super) struct Notices {
    heard: broadcast::Sender<RemoteChange>,
    task: JoinHandle<()>,
}

impl Notices {
    /// Begins to listen. What `server` announces itself is not told.
    pub(super) fn start(options: PgConnectOptions, server: Uuid) -> Self {
        let heard = broadcast::Sender::new(KEPT);
        Self {
            task: tokio::spawn(listen_on(options, server, heard.clone())),
            heard,
        }
    }

    pub(super) fn subscribe(&self) -> broadcast::Receiver<RemoteChange> {
        self.heard.subscribe()
    }

    pub(super) fn stop(&self) {
        self.task.abort();
    }
}

impl Drop for Notices {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Listens, again and again: a connection that breaks is made anew, with pauses that grow while that fails.
async fn listen_on(options: PgConnectOptions, server: Uuid, heard: broadcast::Sender<RemoteChange>) {
    let mut pause = FIRST_PAUSE;
    loop {
        let mut listened = false;
        let Err(error) = listen(&options, server, &heard, &mut listened).await;
        if listened {
            pause = FIRST_PAUSE;
        }
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        tracing::warn!(cause, "no longer listening to other servers; trying again in {pause:?}");
        sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

/// Listens until the connection breaks.
async fn listen(
    options: &PgConnectOptions,
    server: Uuid,
    heard: &broadcast::Sender<RemoteChange>,
    listened: &mut bool,
) -> Result<std::convert::Infallible> {
    // A pool of its own: the listener would take a connection from the others for good.
    let pool: PgPool = PgPoolOptions::new()
        .max_connections(1)
        .acquire_timeout(ANSWER)
        .connect_lazy_with(options.clone());
    let mut listener = PgListener::connect_with(&pool).await?;
    // How long it was not listening is for the caller to know, who makes up for it.
    listener.eager_reconnect(false);
    answered(listener.listen(CHANNEL)).await?;
    *listened = true;
    // Whatever happened before was not heard.
    tell(heard, RemoteChange::Anything);
    loop {
        match timeout(SILENCE, listener.try_recv()).await {
            Ok(Ok(Some(notice))) => {
                if let Some(news) = read(notice.payload(), server) {
                    tell(heard, news);
                }
            }
            Ok(Ok(None)) => return Err(sqlx::Error::Io(std::io::ErrorKind::ConnectionAborted.into()).into()),
            Ok(Err(error)) => return Err(error.into()),
            Err(_) => {
                answered(sqlx::query("SELECT 1").execute(&mut listener)).await?;
            }
        }
    }
}

async fn answered<T>(call: impl Future<Output = sqlx::Result<T>>) -> Result<T> {
    match timeout(ANSWER, call).await {
        Ok(answer) => Ok(answer?),
        Err(_) => Err(errors::no_answer(ANSWER)),
    }
}

fn tell(heard: &broadcast::Sender<RemoteChange>, news: RemoteChange) {
    // An error only says that nobody listens.
    let _ = heard.send(news);
}

/// What the trigger wrote: the server, the job, and a word on the queue. Nothing is to be told of what `server` did.
fn read(text: &str, server: Uuid) -> Option<RemoteChange> {
    let mut words = text.split(' ');
    let by = words.next().and_then(|word| Uuid::try_parse(word).ok());
    if by == Some(server) {
        return None;
    }
    let id = words.next().and_then(|word| Uuid::try_parse(word).ok());
    let queue = match words.next() {
        Some("same") => Some((false, false)),
        Some("grew") => Some((true, false)),
        Some("moved") => Some((false, true)),
        Some("back") => Some((true, true)),
        _ => None,
    };
    let news = id.zip(queue).map(|(id, (queue_grew, queue_moved))| RemoteChange::Job {
        id,
        queue_grew,
        queue_moved,
    });
    // Of another version, or by hand.
    Some(news.unwrap_or(RemoteChange::Anything))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_news_is_no_news_and_what_is_not_understood_may_be_anything() {
        let (own, id) = (Uuid::now_v7(), Uuid::now_v7());
        assert_eq!(read(&format!("{own} {id} moved"), own), None);
        for by in ["-".to_owned(), Uuid::now_v7().to_string()] {
            let wanted = RemoteChange::Job {
                id,
                queue_grew: true,
                queue_moved: false,
            };
            assert_eq!(read(&format!("{by} {id} grew"), own), Some(wanted));
            for other in [format!("{by} {id} sideways"), format!("{by} x same"), String::new()] {
                assert_eq!(read(&other, own), Some(RemoteChange::Anything), "{other}");
            }
        }
    }
}
