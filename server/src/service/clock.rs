//! The time of day as the ledger keeps it, and as the API tells it.
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use prost_types::Timestamp;

/// Microseconds since the epoch, UTC. A clock that stands before 1970 reads as 1970.
pub fn now() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    micros(since)
}

/// A length of time in microseconds.
pub fn micros(duration: Duration) -> i64 {
    i64::try_from(duration.as_micros()).unwrap_or(i64::MAX)
}

/// Microseconds since the epoch as a timestamp.
pub fn timestamp(micros: i64) -> Timestamp {
    Timestamp {
        seconds: micros.div_euclid(1_000_000),
        // Below a thousand million by construction.
        nanos: micros.rem_euclid(1_000_000) as i32 * 1000,
    }
}

/// Microseconds since the epoch as RFC 3339.
pub fn text(micros: i64) -> String {
    let since = Duration::from_micros(u64::try_from(micros).unwrap_or_default());
    humantime::format_rfc3339_micros(UNIX_EPOCH + since).to_string()
}

/// A timestamp of the API in microseconds since the epoch; `None` when it is malformed or far out of reach.
pub fn micros_of(time: &Timestamp) -> Option<i64> {
    let nanos = i64::from(time.nanos);
    let micros = time.seconds.checked_mul(1_000_000)?.checked_add(nanos / 1000)?;
    (0..1_000_000_000).contains(&nanos).then_some(micros)
}

/// A duration of the API, none of it negative; `None` when it is malformed or negative.
pub fn duration(given: prost_types::Duration) -> Option<Duration> {
    let nanos = u32::try_from(given.nanos).ok().filter(|&n| n < 1_000_000_000)?;
    Some(Duration::new(u64::try_from(given.seconds).ok()?, nanos))
}

/// A duration for the API.
pub fn proto_duration(duration: Duration) -> prost_types::Duration {
    prost_types::Duration {
        seconds: i64::try_from(duration.as_secs()).unwrap_or(i64::MAX),
        nanos: duration.subsec_nanos() as i32, // below a thousand million
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timestamps_keep_microseconds() {
        assert_eq!(
            timestamp(1_500_001),
            Timestamp {
                seconds: 1,
                nanos: 500_001_000
            }
        );
        assert_eq!(
            timestamp(-1),
            Timestamp {
                seconds: -1,
                nanos: 999_999_000
            }
        );
    }

    #[test]
    fn timestamps_are_read_back() {
        for micros in [0, 1_500_001, -1, 1_700_000_000_000_000] {
            assert_eq!(micros_of(&timestamp(micros)), Some(micros));
        }
        let of = |seconds, nanos| micros_of(&Timestamp { seconds, nanos });
        assert_eq!((of(i64::MAX, 0), of(0, -1), of(0, 1_000_000_000)), (None, None, None));
    }

    #[test]
    fn malformed_durations_are_refused() {
        let of = |seconds, nanos| duration(prost_types::Duration { seconds, nanos });
        assert_eq!(of(2, 500_000_000), Some(Duration::from_millis(2500)));
        assert_eq!(of(-1, 0), None);
        assert_eq!(of(0, -1), None);
        assert_eq!(of(0, 1_000_000_000), None);
    }
}
