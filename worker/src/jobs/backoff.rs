//! How long to wait before trying again: longer each time, and never as long as everybody else.
use std::time::Duration;

use rand::TryRng;
use rand::rngs::SysRng;

/// The first wait, at most.
const FIRST: Duration = Duration::from_millis(500);
/// No wait is longer.
const LONGEST: Duration = Duration::from_secs(15);

/// Waits between attempts at one thing.
pub struct Backoff {
    next: Duration,
}

impl Backoff {
    /// Begins with the shortest.
    pub fn new() -> Self {
        Self { next: FIRST }
    }

    /// The next wait: between half and all of a time that doubles up to a limit.
    pub fn next(&mut self) -> Duration {
        let wait = self.next;
        self.next = (wait * 2).min(LONGEST);
        // Without random numbers all workers come back at once, which is unkind and no more.
        let random = SysRng.try_next_u32().unwrap_or(u32::MAX);
        wait.mul_f64(0.5 + 0.5 * f64::from(random) / f64::from(u32::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_within_bounds_and_differ() {
        let mut backoff = Backoff::new();
        let waits: Vec<Duration> = (0..40).map(|_| backoff.next()).collect();
        assert!(waits[0] >= FIRST / 2 && waits[0] <= FIRST);
        assert!(waits.iter().all(|wait| *wait <= LONGEST));
        assert!(waits[30..].iter().all(|wait| *wait >= LONGEST / 2));
        assert!(waits[30..].windows(2).any(|pair| pair[0] != pair[1]));
    }
}
