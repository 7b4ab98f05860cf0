//! What has to be done without anybody asking: ending leases that have expired, and deleting what nobody can want.
use std::time::Duration;

use tokio::time::{Instant, MissedTickBehavior, interval};

use crate::artifacts::ArtifactPath;
use crate::error::{Error, Result, chain};
use crate::ledger::{ArtifactRow, JobId};
use crate::service::store_generation::{self, CONTESTED, Standing};
use crate::service::{Service, clock};

/// How late an expired lease may be noticed.
const REAP_EVERY: Duration = Duration::from_secs(1);
/// When leases could not be looked after for so long, reports of workers could not be written either.
const ABSENCE: Duration = Duration::from_secs(3);
/// How often abandoned bytes are looked for, at most.
const COLLECT_EVERY: Duration = Duration::from_secs(10);
/// How often what is too old is looked for, at most.
const EXPIRE_EVERY: Duration = Duration::from_secs(60);
/// How often is asked whether the store is still this ledger's, at most.
const STANDING_EVERY: Duration = Duration::from_secs(60);
/// How often all that lies in the store is looked at, at least.
const ORPHANS_EVERY: Duration = Duration::from_secs(6 * 60 * 60);
/// Artifacts deleted at one go.
const COLLECT_AT_ONCE: u32 = 100;

/// Keeps house until the API is stopped. A failure is logged, and tried again the next time.
pub async fn housekeeping(api: Service) {
    let mut stopping = api.changes().listen();
    // Beside each other: a store that is slow must not keep leases from being ended.
    let work = async { tokio::join!(look_after_leases(&api), delete(&api)) };
    tokio::select! {
        () = stopping.stopped() => {}
        _ = work => {}
    }
}

async fn look_after_leases(api: &Service) {
    let mut ticks = interval(REAP_EVERY);
    // Never yet, as far as this server knows.
    let mut looked: Option<Looked> = None;
    let absence = ABSENCE.max(api.limits().lease / 2);
    loop {
        ticks.tick().await;
        let now = Looked::now();
        match api
            .look_after_leases(looked.is_none_or(|last| now.since(last) > absence))
            .await
        {
            Ok(()) => looked = Some(now),
            Err(error) => tracing::error!(error = %chain(&error), "expired leases could not be ended"),
        }
    }
}

/// When leases were looked after, by two clocks.
#[derive(Clone, Copy, Debug)]
struct Looked {
    /// Stands still while a virtual machine is paused, and goes on while the clock on the wall is set back.
    awake: Instant,
    /// What leases end by: microseconds since 1970. It has moved on when a machine wakes up.
    wall: i64,
}

impl Looked {
    fn now() -> Self {
        Self {
            awake: Instant::now(),
            wall: clock::now(),
        }
    }

    /// How long ago `last` was, by the clock that says the most.
    fn since(self, last: Self) -> Duration {
        let wall = u64::try_from(self.wall.saturating_sub(last.wall)).unwrap_or(0);
        self.awake
            .saturating_duration_since(last.awake)
            .max(Duration::from_micros(wall))
    }
}

async fn delete(api: &Service) {
    let abandoned_after = api.limits().abandoned_after;
    let mut ticks = interval(COLLECT_EVERY.min(abandoned_after));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let expire_every = EXPIRE_EVERY.min(abandoned_after);
    let orphans_every = (abandoned_after / 4).clamp(COLLECT_EVERY, ORPHANS_EVERY);
    let mut expired: Option<Instant> = None;
    let mut stood: Option<(Instant, bool)> = None;
    // Not at the start: listing all there is takes a store's time, and orphans can wait.
    let mut searched = Instant::now();
    loop {
        ticks.tick().await;
        api.end_paused_uploads();
        if expired.is_none_or(|at| at.elapsed() >= expire_every) {
            expired = Some(Instant::now());
            if let Err(error) = api.expire().await {
                tracing::error!(error = %chain(&error), "what is too old could not be deleted");
            }
        }
        if stood.is_none_or(|(at, _)| at.elapsed() >= STANDING_EVERY) {
            stood = Some((Instant::now(), api.is_ours().await));
        }
        if !stood.is_some_and(|(_, ours)| ours) {
            continue;
        }
        // Not since this task began: calls may have been taken before it, and their bytes may still be arriving.
        if let Err(error) = api.collect(api.opened()).await {
            tracing::error!(error = %chain(&error), "abandoned artifacts could not be deleted");
        }
        if let Err(error) = api.end_reservations().await {
            tracing::error!(error = %chain(&error), "bytes of uploads that were not finished could not be given back");
        }
        if searched.elapsed() >= orphans_every {
            searched = Instant::now();
            if let Err(error) = api.collect_orphans().await {
                tracing::error!(error = %chain(&error), "bytes that nothing points at could not be looked for");
            }
        }
    }
}

impl Service {
    /// Ends attempts whose lease has expired. While no server was there, or it could not write, no worker could report;
    /// `after_absence` those that live get the time to, before any is given up.
    async fn look_after_leases(&self, after_absence: bool) -> Result<()> {
        if after_absence {
            self.ledger().renew_leases(self.limits().lease, clock::now()).await?;
        }
        self.reap().await
    }

    /// Ends attempts whose lease has expired.
    pub(crate) async fn reap(&self) -> Result<()> {
        let ended = self.ledger().reap(clock::now()).await?;
        for &job in &ended {
            tracing::warn!(%job, "the lease has expired: its worker is gone");
            self.progress_throttle().forget(job);
            self.count_lost(job).await;
            self.changes().job(job);
        }
        if !ended.is_empty() {
            self.changes().queue_grew();
            self.changes().queue_moved();
        }
        Ok(())
    }

    /// Counts an attempt whose worker was lost. Figures are not worth an error.
    async fn count_lost(&self, id: JobId) {
        let metrics = self.metrics();
        let now = Instant::now().into_std();
        self.stages().end(id, "lost", now, &metrics, self.traces());
        match self.ledger().get_job(id).await {
            Ok(Some(job)) => {
                metrics.attempt_ended(&job, true);
            }
            Ok(None) => {}
            Err(error) => tracing::warn!(job = %id, error = %chain(&error), "a lost attempt is not counted"),
        }
    }

    /// Whether the store is this ledger's to delete from, as far as is known.
    pub(crate) async fn is_ours(&self) -> bool {
        let standing = match store_generation::standing(self.ledger(), self.store(), clock::now()).await {
            Ok(Standing::Behind) => {
                // Whoever it went on with is to hear of it before it deletes what came here meanwhile.
                let contested = self.store().contest().await.map_err(Error::from);
                contested.map(|()| Standing::Contested)
            }
            other => other,
        };
        match standing {
            Ok(Standing::Ours) => true,
            Ok(_) => {
                tracing::error!(place = %self.store().place(), "{CONTESTED}");
                false
            }
            Err(error) => {
                tracing::error!(error = %chain(&error), "whose the artifacts are can't be seen, so nothing is deleted");
                false
            }
        }
    }

    /// Deletes what uploads and attempts left behind. What was begun before this server was `started` is nobody's any
    /// more, unless the ledger has other servers; what was begun since, or by them, may still be arriving for as long as
    /// that is allowed.
    pub(crate) async fn collect(&self, started: i64) -> Result<()> {
        let longest = clock::micros(self.limits().abandoned_after);
        let longest_ago = clock::now().saturating_sub(longest);
        let older_than = match self.ledger().is_shared() {
            true => longest_ago,
            false => started.max(longest_ago),
        };
        let abandoned = self.ledger().abandoned_artifacts(older_than, COLLECT_AT_ONCE).await?;
        for artifact in &abandoned {
            match self.remove_bytes(artifact).await {
                Ok(()) => tracing::info!(artifact = %artifact.id, "deleted what was abandoned"),
                // The others are not to wait for this one, the next time either.
                Err(error) => {
                    tracing::error!(artifact = %artifact.id, error = %chain(&error), "could not be deleted");
                    self.ledger().put_off_artifact(artifact.id, clock::now()).await?;
                }
            }
        }
        Ok(())
    }

    /// Gives back what was reserved for uploads of which nothing more can come, and deletes what was sent.
    pub(crate) async fn end_reservations(&self) -> Result<()> {
        let ended = self.ledger().ended_reservations(clock::now(), COLLECT_AT_ONCE);
        for id in ended.await? {
            self.store().delete(&ArtifactPath::staged(id)).await?;
            self.ledger().release_upload(id).await?;
        }
        Ok(())
    }

    /// Deletes the bytes of an artifact that the ledger no longer shows, then its row.
    pub(crate) async fn remove_bytes(&self, artifact: &ArtifactRow) -> Result<()> {
        self.store().delete(&ArtifactPath::parse(&artifact.path)?).await?;
        Ok(self.ledger().forget_artifact(artifact.id).await?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_that_was_paused_was_absent() {
        let last = Looked::now();
        let hour = Duration::from_secs(3600);
        let later = |awake: Duration, wall: i64| Looked {
            awake: last.awake + awake,
            wall: last.wall + wall,
        };
        assert_eq!(later(REAP_EVERY, 1_000_000).since(last), REAP_EVERY);
        // It woke up an hour later, and counted a second.
        assert_eq!(later(REAP_EVERY, 3_600_000_000).since(last), hour);
        // Somebody set the clock back.
        assert_eq!(later(hour, -3_600_000_000).since(last), hour);
    }
}
