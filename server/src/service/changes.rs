//! Who waits for a change hears of it: watchers of jobs, and workers that wait for one.
//!
//! Nothing here is needed for what is told to be right: whoever waits also looks into the ledger every so often, and a
//! change that was missed is seen then. What other servers change comes in through [`relay`](crate::tasks::remote_changes).
use std::time::Duration;

use tokio::sync::{broadcast, watch};

use crate::error::{Error, Result};
use crate::ledger::JobId;

/// Changes that a watcher may be late by; one that is later still just looks again.
const KEPT: usize = 256;

/// Announces changes.
pub struct Changes {
    /// `None` stands for any job.
    jobs: broadcast::Sender<Option<JobId>>,
    grew: watch::Sender<()>,
    moved: watch::Sender<()>,
    stopping: watch::Sender<bool>,
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            jobs: broadcast::Sender::new(KEPT),
            grew: watch::Sender::new(()),
            moved: watch::Sender::new(()),
            stopping: watch::Sender::new(false),
        }
    }
}

impl Changes {
    /// A job has changed. Never waits, however slow those who listen are.
    pub fn job(&self, id: JobId) {
        // An error only says that nobody listens.
        let _ = self.jobs.send(Some(id));
    }

    /// Anything may have changed.
    pub fn everything(&self) {
        // As above.
        let _ = self.jobs.send(None);
        self.queue_grew();
        self.queue_moved();
    }

    /// There may be a job for a worker that waits.
    pub fn queue_grew(&self) {
        self.grew.send_replace(());
    }

    /// Queued jobs have other positions now.
    pub fn queue_moved(&self) {
        self.moved.send_replace(());
    }

    /// The server is going down.
    pub fn stop(&self) {
        self.stopping.send_replace(true);
    }

    /// Begins to listen to everything from now on.
    pub fn listen(&self) -> Listener {
        Listener {
            jobs: self.jobs.subscribe(),
            grew: self.grew.subscribe(),
            moved: self.moved.subscribe(),
            stopping: self.stopping.subscribe(),
        }
    }
}

/// What somebody waits for.
#[derive(Clone, Copy, Debug)]
pub enum For {
    /// A change of this job.
    Job(JobId),
    /// A change of this job, which is queued: others that leave the queue count too.
    QueuedJob(JobId),
    /// A job that a worker could be given.
    Work,
}

/// Why waiting ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// What was waited for happened, or may have.
    It,
    /// Others left the queue.
    Moved,
    /// Nothing, for long enough.
    Nothing,
}

/// Hears of changes from when it was made.
pub struct Listener {
    jobs: broadcast::Receiver<Option<JobId>>,
    grew: watch::Receiver<()>,
    moved: watch::Receiver<()>,
    stopping: watch::Receiver<bool>,
}

impl Listener {
    /// Fails when the server is going down.
    pub fn check_running(&self) -> Result<()> {
        if *self.stopping.borrow() {
            Err(Error::Stopping)
        } else {
            Ok(())
        }
    }

    /// Returns when the server is going down.
    pub async fn stopped(&mut self) {
        // An error would say that the sender is gone, and with it the server.
        let _ = self.stopping.wait_for(|&stopping| stopping).await;
    }

    /// Returns when what is waited for happened, may have happened, or `longest` is over. Fails as soon as the server is
    /// going down.
    pub async fn wait(&mut self, what: For, longest: Duration) -> Result<Heard> {
        let Self {
            jobs,
            grew,
            moved,
            stopping,
        } = self;
        let (id, queued, work) = match what {
            For::Job(id) => (Some(id), false, false),
            For::QueuedJob(id) => (Some(id), true, false),
            For::Work => (None, false, true),
        };
        tokio::select! {
            // The job itself first: it is not to be taken for the others.
            biased;
            () = job(jobs, id), if id.is_some() => Ok(Heard::It),
            _ = grew.changed(), if work => Ok(Heard::It),
            _ = moved.changed(), if queued => Ok(Heard::Moved),
            // An error would say that the sender is gone, and with it the server.
            _ = stopping.wait_for(|&stopping| stopping) => Err(Error::Stopping),
            () = tokio::time::sleep(longest) => Ok(Heard::Nothing),
        }
    }
}

async fn job(jobs: &mut broadcast::Receiver<Option<JobId>>, id: Option<JobId>) {
    loop {
        match jobs.recv().await {
            Ok(changed) if changed.is_some() && changed != id => {}
            // Too many changes at once: this job's may be among those that were dropped.
            Ok(_) | Err(broadcast::error::RecvError::Lagged(_)) => return,
            Err(broadcast::error::RecvError::Closed) => std::future::pending().await,
        }
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    const LONG: Duration = Duration::from_secs(3600);
    const SHORT: Duration = Duration::from_millis(20);

    /// Whether waiting ended before a change was missed.
    async fn hears(listener: &mut Listener, what: For) -> bool {
        tokio::time::timeout(SHORT, listener.wait(what, LONG)).await.is_ok()
    }

    #[tokio::test]
    async fn each_hears_what_it_waits_for() {
        let (changes, a, b) = (Changes::default(), Uuid::now_v7(), Uuid::now_v7());
        let mut listener = changes.listen();
        changes.job(b);
        changes.queue_moved();
        assert!(!hears(&mut listener, For::Job(a)).await);
        assert_eq!(listener.wait(For::QueuedJob(a), LONG).await.unwrap(), Heard::Moved);
        assert!(!hears(&mut listener, For::Work).await);
        changes.job(a);
        assert!(hears(&mut listener, For::Job(a)).await);
        changes.queue_grew();
        assert!(hears(&mut listener, For::Work).await);
        assert!(!hears(&mut listener, For::Work).await);
        assert_eq!(listener.wait(For::Work, SHORT).await.unwrap(), Heard::Nothing);
    }

    #[tokio::test]
    async fn all_hear_that_anything_may_have_changed() {
        let (changes, a) = (Changes::default(), Uuid::now_v7());
        for what in [For::Job(a), For::QueuedJob(a), For::Work] {
            let mut listener = changes.listen();
            changes.everything();
            assert!(hears(&mut listener, what).await, "{what:?}");
        }
    }

    #[tokio::test]
    async fn one_who_is_late_looks_again() {
        let (changes, a) = (Changes::default(), Uuid::now_v7());
        let mut listener = changes.listen();
        changes.job(a);
        for _ in 0..2 * KEPT {
            changes.job(Uuid::now_v7());
        }
        assert!(hears(&mut listener, For::Job(a)).await);
    }

    #[tokio::test]
    async fn stopping_ends_every_wait() {
        let changes = Changes::default();
        let mut listener = changes.listen();
        listener.check_running().unwrap();
        changes.stop();
        for what in [For::Work, For::Job(Uuid::nil())] {
            assert!(matches!(listener.wait(what, LONG).await, Err(Error::Stopping)));
        }
        assert!(matches!(changes.listen().check_running(), Err(Error::Stopping)));
    }
}
