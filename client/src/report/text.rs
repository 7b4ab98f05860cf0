//! Values of the API as reports spell them.

/// A value of an enum as a word: `STATE_QUEUED` without `STATE_` is `queued`.
pub fn word(name: &str, prefix: &str) -> String {
    name.strip_prefix(prefix).unwrap_or(name).to_ascii_lowercase()
}

/// A time as RFC 3339.
pub fn time(time: Option<prost_types::Timestamp>) -> Option<String> {
    time.map(|time| time.to_string())
}

/// A duration in seconds.
pub fn seconds(duration: Option<prost_types::Duration>) -> f64 {
    duration.map_or(0.0, |d| d.seconds as f64 + f64::from(d.nanos) * 1e-9)
}

/// A text, if there is one.
pub fn some(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}

/// A line of its own where rows of a scene were ignored.
pub fn rows_ignored(count: u64) -> String {
    match count {
        0 => String::new(),
        1 => "\n1 row ignored".into(),
        count => format!("\n{count} rows ignored"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_times_and_durations() {
        assert_eq!(word("STATE_QUEUED", "STATE_"), "queued");
        assert_eq!(word("VERDICT_NO_MATCH", "VERDICT_"), "no_match");
        let duration = prost_types::Duration {
            seconds: 2,
            nanos: 500_000_000,
        };
        assert_eq!(seconds(Some(duration)), 2.5);
        let zero = prost_types::Timestamp { seconds: 0, nanos: 0 };
        assert_eq!(time(Some(zero)).unwrap(), "1970-01-01T00:00:00Z");
    }
}
