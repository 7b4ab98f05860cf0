//! When a message that was not acknowledged is sent again, and when no more.
use std::time::Duration;

use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::ledger::DeliveryRow;

/// The pause after the first attempt, in microseconds; then four times as long, and so on.
const FIRST: i64 = 5_000_000;
/// The longest pause.
const LONGEST: i64 = 60 * 60 * 1_000_000;

/// When a delivery is to be sent next after an attempt that failed at `now`; `None` when it is to be given up.
pub fn next_attempt(delivery: &DeliveryRow, give_up_after: Duration, now: i64) -> Option<i64> {
    let next = now.saturating_add(pause(delivery.id, delivery.attempts));
    let longest = i64::try_from(give_up_after.as_micros()).unwrap_or(i64::MAX);
    (next.saturating_sub(delivery.since) <= longest).then_some(next)
}

/// 5 s, 20 s, 80 s and so on to an hour, each up to a quarter longer, so that what failed together does not come back
/// together. How much longer follows from the delivery and the attempt.
fn pause(id: Uuid, attempts: i32) -> i64 {
    let quadruplings = u32::try_from(attempts.saturating_sub(1)).unwrap_or(0).min(10);
    let pause = (FIRST << (2 * quadruplings)).min(LONGEST);
    let mut hash = Sha256::new();
    hash.update(id.as_bytes());
    hash.update(attempts.to_be_bytes());
    pause + pause / 4 * i64::from(hash.finalize()[0]) / 256
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_to_an_hour_and_differ() {
        let id = Uuid::now_v7();
        let seconds = [5, 20, 80, 320, 1280, 3600, 3600];
        for (attempt, least) in (1..).zip(seconds) {
            let pause = pause(id, attempt);
            let least = least * 1_000_000;
            assert!((least..least * 5 / 4).contains(&pause), "{attempt}: {pause}");
        }
        for odd in [0, -1, i32::MIN, i32::MAX] {
            assert!((FIRST..=LONGEST * 5 / 4).contains(&pause(id, odd)));
        }
        let others: std::collections::HashSet<_> = (0..50).map(|_| pause(Uuid::now_v7(), 3)).collect();
        assert!(others.len() > 20, "{}", others.len());
    }
}
