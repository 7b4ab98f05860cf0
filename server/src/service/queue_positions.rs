//! Places in the queue for all who watch jobs that wait: counted once for all of them, and not for each.
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::Mutex;

use crate::error::Result;
use crate::ledger::JobId;
use crate::service::Service;

/// How long they are good for. Who heard of a move waits as long, and so never sees places from before it.
pub const FRESH: Duration = Duration::from_millis(500);

/// Of each job, how many go first.
type Places = HashMap<JobId, i64>;

/// The places as they were last counted.
#[derive(Default)]
pub struct Positions(Mutex<Option<(Instant, Arc<Places>)>>);

impl Service {
    /// Queued jobs before each that is queued.
    pub(crate) async fn positions(&self) -> Result<Arc<Places>> {
        // Held while they are counted: others wait for the outcome instead of counting too.
        let mut last = self.shared.positions.0.lock().await;
        if let Some((counted, positions)) = &*last
            && counted.elapsed() < FRESH
        {
            return Ok(positions.clone());
        }
        let counted = Instant::now();
        let queue = self.ledger().queue().await?;
        let positions: Arc<Places> = Arc::new(queue.into_iter().zip(0..).collect());
        *last = Some((counted, positions.clone()));
        Ok(positions)
    }
}
