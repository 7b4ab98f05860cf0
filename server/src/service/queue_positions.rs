//! Places in the queue for all who watch or list jobs that wait: counted once for all of them, and not for each.
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::Mutex;

use crate::error::Result;
use crate::ledger::{JobId, JobRow, JobState};
use crate::service::Service;

/// How long they are good for. Who heard of a move waits as long, and so never sees places from before it.
pub const FRESH: Duration = Duration::from_millis(500);
/// Or so long, for whoever asks for a job that came since. Whatever is asked, the queue is not walked more often.
const FRESH_FOR_NEW: Duration = Duration::from_millis(50);

/// Of each job, how many go first.
type Places = HashMap<JobId, i64>;

/// The places as they were last counted.
#[derive(Default)]
pub struct QueuePositions(Mutex<Counted>);

#[derive(Default)]
struct Counted {
    last: Option<(Instant, Arc<Places>)>,
    /// How often.
    times: u64,
}

impl Service {
    /// Queued jobs before each that is queued.
    pub(crate) async fn positions(&self) -> Result<Arc<Places>> {
        self.positions_of(&[]).await
    }

    /// The same, counted again if one of these came since.
    async fn positions_of(&self, jobs: &[JobId]) -> Result<Arc<Places>> {
        // Held while they are counted: others wait for the outcome instead of counting too.
        let mut counted = self.shared.positions.0.lock().await;
        if let Some((at, positions)) = &counted.last {
            let all = jobs.iter().all(|job| positions.contains_key(job));
            if at.elapsed() < if all { FRESH } else { FRESH_FOR_NEW } {
                return Ok(positions.clone());
            }
        }
        let at = Instant::now();
        let queue = self.ledger().queue().await?;
        let positions: Arc<Places> = Arc::new(queue.into_iter().zip(0..).collect());
        counted.last = Some((at, positions.clone()));
        counted.times += 1;
        Ok(positions)
    }

    /// Tells those of a list that wait their places.
    pub(crate) async fn place(&self, jobs: &mut [JobRow]) -> Result<()> {
        let queued = jobs.iter().filter(|job| job.state == JobState::Queued);
        let queued: Vec<JobId> = queued.map(|job| job.id).collect();
        if queued.is_empty() {
            return Ok(());
        }
        let positions = self.positions_of(&queued).await?;
        for job in jobs.iter_mut().filter(|job| job.state == JobState::Queued) {
            job.queue_position = positions.get(&job.id).copied();
        }
        Ok(())
    }

    /// How often the queue was walked.
    #[cfg(test)]
    pub(crate) async fn positions_counted(&self) -> u64 {
        self.shared.positions.0.lock().await.times
    }
}
