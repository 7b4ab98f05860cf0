//! What bytes under way may take of the memory: windows of downloads and parts of uploads draw from one budget.
use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// The budget is counted in so many bytes.
const UNIT: u64 = 1 << 10;

/// A budget of memory. Whoever asks waits for those who asked before. Cheap to clone.
#[derive(Clone, Debug)]
pub struct TransferMemory {
    budget: Arc<Semaphore>,
    units: u32,
}

/// A part of the budget, until it is dropped.
#[derive(Debug)]
pub struct Held(#[allow(dead_code)] Option<OwnedSemaphorePermit>);

impl TransferMemory {
    /// A budget of so many bytes.
    pub fn new(bytes: u64) -> Self {
        let units = u32::try_from(bytes / UNIT).unwrap_or(u32::MAX).max(1);
        Self {
            budget: Arc::new(Semaphore::new(units as usize)),
            units,
        }
    }

    /// Waits for so many bytes. More than there is at all is all of it.
    pub async fn hold(&self, bytes: usize) -> Held {
        let units = (bytes as u64).div_ceil(UNIT).min(self.units.into()) as u32; // at most as many as there are
        // It is never closed.
        Held(self.budget.clone().acquire_many_owned(units).await.ok())
    }

    /// Bytes that nobody holds.
    #[cfg(test)]
    pub fn free(&self) -> u64 {
        self.budget.available_permits() as u64 * UNIT
    }
}

impl Default for TransferMemory {
    fn default() -> Self {
        Self::new(128 << 20)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::time::timeout;

    use super::*;

    #[tokio::test]
    async fn what_is_held_is_waited_for() {
        let memory = TransferMemory::new(10 << 10);
        let held = memory.hold(6 << 10).await;
        assert_eq!(memory.free(), 4 << 10);
        let short = Duration::from_millis(20);
        assert!(timeout(short, memory.hold(5 << 10)).await.is_err());
        drop(held);
        // More than there is does not wait for ever.
        let all = timeout(short, memory.hold(1 << 30)).await.unwrap();
        assert_eq!(memory.free(), 0);
        drop(all);
        assert_eq!(memory.free(), 10 << 10);
    }
}
