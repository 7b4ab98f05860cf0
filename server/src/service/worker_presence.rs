//! Whether any worker is there: one that waits for a job, or that was heard of lately.
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A worker that was heard of so long ago is there. Workers report every second, and are back at once for another job.
pub const LATELY: Duration = Duration::from_secs(30);

/// What is known of workers, by what they say to this server.
#[derive(Debug, Default)]
pub struct Alive {
    waiting: AtomicUsize,
    heard: Mutex<Option<Instant>>,
}

impl Alive {
    /// A worker says something.
    pub fn heard(&self) {
        // What it holds is whole at every moment.
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// A worker waits for a job, until the answer is dropped.
    pub fn wait(&self) -> Waiting<'_> {
        self.waiting.fetch_add(1, Ordering::Relaxed);
        Waiting(self)
    }

    /// Whether one is there.
    pub fn alive(&self) -> bool {
        let heard = *self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        self.waiting.load(Ordering::Relaxed) > 0 || heard.is_some_and(|at| at.elapsed() < LATELY)
    }
}

/// A worker that waits.
pub struct Waiting<'a>(&'a Alive);

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.heard();
        self.0.waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_that_waits_or_was_heard_is_there() {
        let workers = Alive::default();
        assert!(!workers.alive());
        let waiting = workers.wait();
        assert!(workers.alive());
        drop(waiting);
        assert!(workers.alive(), "just now");
        assert_eq!(workers.waiting.load(Ordering::Relaxed), 0);
        *workers.heard.lock().unwrap() = Instant::now().checked_sub(LATELY);
        assert!(!workers.alive());
        workers.heard();
        assert!(workers.alive());
    }
}
