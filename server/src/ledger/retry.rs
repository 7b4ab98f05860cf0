//! How long a job waits after a failed attempt.

/// Longest wait, in microseconds.
const CAP: i64 = 5 * 60 * 1_000_000;

/// Microseconds to wait after failed attempt `attempt` (the first is 1): 2 s, 8 s, 32 s and so on, at most 5 minutes.
pub fn backoff(attempt: i32) -> i64 {
    let doublings = u32::try_from(attempt.saturating_sub(1)).unwrap_or(0).min(8) * 2;
    (2_000_000_i64 << doublings).min(CAP)
}

#[cfg(test)]
mod tests {
    use super::backoff;

    #[test]
    fn grows_by_four_up_to_five_minutes() {
        let seconds: Vec<i64> = [1, 2, 3, 4, 5, i32::MAX, 0, i32::MIN]
            .map(|a| backoff(a) / 1_000_000)
            .to_vec();
        assert_eq!(seconds, [2, 8, 32, 128, 300, 300, 2, 2]);
    }
}
