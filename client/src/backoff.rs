//! How long to wait before a lost server is tried again, and when to give it up.
use std::time::{Duration, Instant};

/// The first wait.
const FIRST: Duration = Duration::from_millis(250);
/// The longest wait.
pub const LONGEST: Duration = Duration::from_secs(10);

/// Waits that double, until nothing was heard for too long.
#[derive(Debug)]
pub struct Backoff {
    limit: Duration,
    lost_since: Option<Instant>,
    next: Duration,
}

impl Backoff {
    /// Gives up when nothing was heard for `limit`.
    pub fn new(limit: Duration) -> Self {
        Self {
            limit,
            lost_since: None,
            next: FIRST,
        }
    }

    /// Something was heard: all is well again.
    pub fn heard(&mut self) {
        self.lost_since = None;
        self.next = FIRST;
    }

    /// Whether contact is lost at present.
    pub fn is_lost(&self) -> bool {
        self.lost_since.is_some()
    }

    /// Nothing was heard at `now`: the time to wait, at least what the server `asked` for, or `None` to give up.
    pub fn lost(&mut self, now: Instant, asked: Option<Duration>) -> Option<Duration> {
        let since = *self.lost_since.get_or_insert(now);
        let wait = self.next.max(asked.unwrap_or_default());
        if now.saturating_duration_since(since) + wait > self.limit {
            return None;
        }
        self.next = (self.next * 2).min(LONGEST);
        Some(wait)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest_and_end_with_the_limit() {
        let mut backoff = Backoff::new(Duration::from_secs(60));
        let mut now = Instant::now();
        let start = now;
        let mut waits = Vec::new();
        while let Some(wait) = backoff.lost(now, None) {
            waits.push(wait.as_millis());
            now += wait;
        }
        assert_eq!(waits[..7], [250, 500, 1000, 2000, 4000, 8000, 10_000]);
        assert!(now - start <= Duration::from_secs(60));
        assert!(backoff.is_lost());
    }

    #[test]
    fn hearing_something_begins_anew() {
        let mut backoff = Backoff::new(Duration::from_secs(2));
        let now = Instant::now();
        assert!(backoff.lost(now, None).is_some());
        assert!(backoff.lost(now + Duration::from_secs(5), None).is_none());
        backoff.heard();
        let later = now + Duration::from_secs(5);
        assert_eq!(backoff.lost(later, None), Some(FIRST));
    }

    #[test]
    fn the_server_may_ask_for_more() {
        let mut backoff = Backoff::new(Duration::from_secs(5));
        let wait = backoff.lost(Instant::now(), Some(Duration::from_secs(3)));
        assert_eq!(wait, Some(Duration::from_secs(3)));
        assert_eq!(backoff.lost(Instant::now(), Some(Duration::from_secs(9))), None);
    }
}
