//! How often progress is written: at most once a second a job. What comes sooner is kept here and written with the
//! next report; whether the job is to end is read from the ledger every time all the same.
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sha2::{Digest, Sha256};

use crate::ledger::{JobId, Progress};

/// Least time between two writes.
const EVERY: Duration = Duration::from_secs(1);

/// The reports of all jobs that are running.
#[derive(Default)]
pub struct ProgressThrottle(Mutex<HashMap<JobId, Reported>>);

/// The reports of one attempt.
struct Reported {
    /// SHA-256 of the lease token, for tokens are kept nowhere.
    lease: [u8; 32],
    written: Instant,
    /// Newer than what was written.
    progress: Option<Progress>,
}

impl ProgressThrottle {
    /// What is to be written for this report: `None` when it is too soon, else the newest progress, if there is any.
    /// The lease is extended by writes only, so a short one is written more often.
    pub fn due(
        &self,
        id: JobId,
        token: &str,
        progress: Option<Progress>,
        lease: Duration,
        now: Instant,
    ) -> Option<Option<Progress>> {
        let mut all = self.lock();
        let Some(reported) = all.get_mut(&id).filter(|reported| reported.lease == hash(token)) else {
            return Some(progress);
        };
        let newest = progress.or_else(|| reported.progress.take());
        if now.saturating_duration_since(reported.written) >= EVERY.min(lease / 4) {
            return Some(newest);
        }
        reported.progress = newest;
        None
    }

    /// A report was written, which also says that the token is the job's.
    pub fn written(&self, id: JobId, token: &str, now: Instant) {
        self.lock().insert(
            id,
            Reported {
                lease: hash(token),
                written: now,
                progress: None,
            },
        );
    }

    /// The attempt is over.
    pub fn forget(&self, id: JobId) {
        self.lock().remove(&id);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, Reported>> {
        // Nobody panics while holding it, and what it holds is whole at every moment anyway.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn hash(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    const LEASE: Duration = Duration::from_secs(30);

    fn done(done: i64) -> Progress {
        Progress {
            done,
            ..Progress::default()
        }
    }

    #[test]
    fn one_write_a_second_with_the_newest_progress() {
        let (reports, id, start) = (ProgressThrottle::default(), Uuid::now_v7(), Instant::now());
        let due = |progress: Option<i64>, ms| {
            reports.due(
                id,
                "token",
                progress.map(done),
                LEASE,
                start + Duration::from_millis(ms),
            )
        };
        assert_eq!(due(Some(1), 0), Some(Some(done(1))));
        reports.written(id, "token", start);
        assert_eq!(due(Some(2), 300), None);
        assert_eq!(due(Some(3), 600), None);
        assert_eq!(due(None, 900), None);
        assert_eq!(due(None, 1000), Some(Some(done(3))));
        reports.written(id, "token", start + Duration::from_secs(1));
        assert_eq!(due(None, 2000), Some(None));
    }

    #[test]
    fn attempts_are_kept_apart() {
        let (reports, id, now) = (ProgressThrottle::default(), Uuid::now_v7(), Instant::now());
        reports.written(id, "old", now);
        assert_eq!(reports.due(id, "old", Some(done(1)), LEASE, now), None);
        assert_eq!(reports.due(id, "new", None, LEASE, now), Some(None));
        reports.forget(id);
        assert_eq!(reports.due(id, "old", None, LEASE, now), Some(None));
    }

    #[test]
    fn a_short_lease_is_written_more_often() {
        let (reports, id, now) = (ProgressThrottle::default(), Uuid::now_v7(), Instant::now());
        let lease = Duration::from_secs(1);
        reports.written(id, "t", now);
        assert_eq!(
            reports.due(id, "t", None, lease, now + Duration::from_millis(200)),
            None
        );
        assert_eq!(
            reports.due(id, "t", None, lease, now + Duration::from_millis(250)),
            Some(None)
        );
    }
}
