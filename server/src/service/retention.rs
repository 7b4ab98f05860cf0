//! Deletes by age, where the operator says so.
use std::time::Duration;

use crate::error::Result;
use crate::ledger::Before;
use crate::service::{Service, clock};

/// Things that go at one go: a transaction must not hold up others for long.
const AT_ONCE: u32 = 100;

/// How long things are kept that are over; none for ever.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RetentionPolicy {
    /// Uploads, since they were last used.
    pub uploads: Option<Duration>,
    /// What jobs made, since their end.
    pub outputs: Option<Duration>,
    /// Jobs and all that they made, since their end.
    pub jobs: Option<Duration>,
}

impl RetentionPolicy {
    fn before(self, now: i64) -> Before {
        let before = |age: Option<Duration>| age.map(|age| now.saturating_sub(clock::micros(age)));
        Before {
            uploads: before(self.uploads),
            outputs: before(self.outputs),
            jobs: before(self.jobs),
        }
    }
}

impl Service {
    /// Marks as deleted what is too old, for `collect` to delete, and removes jobs of which nothing is left.
    pub(crate) async fn expire(&self) -> Result<()> {
        let before = self.limits().retention.before(clock::now());
        if before == Before::default() {
            return Ok(());
        }
        loop {
            let expired = self.ledger().expire(before, AT_ONCE).await?;
            let (artifacts, jobs) = (expired.artifacts, expired.jobs);
            if artifacts == 0 && jobs == 0 {
                return Ok(());
            }
            tracing::info!(artifacts, jobs, "deleted what was kept long enough");
        }
    }
}
