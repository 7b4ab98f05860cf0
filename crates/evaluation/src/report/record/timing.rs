//! Where and when seconds were measured: what it takes to say whether two of them can be compared.
use super::check::{amount, bad, maybe, named};
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Where and when an embedding was timed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Name of the processor.
    pub processor: String,
    /// Its logical cores, as far as this process may use them.
    pub cores: u32,
    /// Threads that computed.
    pub threads: u32,
    /// When the program was started that measured this, as RFC 3339; the same for all that it measured.
    pub run: String,
    /// When the embedding began, as RFC 3339.
    pub began: String,
    /// Mean number of programs that wanted to compute in the minute before the run, if the system tells. On a quiet
    /// machine it is near 0.
    pub load_before: Option<f64>,
    /// Processor time of the embedding in seconds, over all threads, if the system tells. Beside other programs it grows
    /// less than the wall time does; of a graphics card it says nothing.
    pub processor_seconds: Option<f64>,
}

impl Timing {
    pub(super) fn check(&self) -> Result<()> {
        named("processor", &self.processor)?;
        named("run", &self.run)?;
        named("began", &self.began)?;
        if self.cores == 0 || self.threads == 0 {
            return bad("threads", format!("{} on {} cores", self.threads, self.cores));
        }
        maybe("load_before", self.load_before, amount)?;
        maybe("processor_seconds", self.processor_seconds, amount)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::record::{Mark, Record};
    use crate::report::testing::{Change, mark, timing};

    #[test]
    fn impossible_timings_are_refused() {
        let changes: [Change<Timing>; 5] = [
            ("processor", |t| t.processor.clear()),
            ("run", |t| t.run = " ".into()),
            ("threads", |t| t.threads = 0),
            ("load_before", |t| t.load_before = Some(f64::NAN)),
            ("processor_seconds", |t| t.processor_seconds = Some(-1.0)),
        ];
        for (field, change) in changes {
            let mut broken = timing("2026-01-01T00:00:00Z");
            broken.check().unwrap();
            change(&mut broken);
            let reason = broken.check().unwrap_err().to_string();
            assert!(reason.starts_with(field), "{field}: {reason}");
        }
    }

    #[test]
    fn marks_of_before_have_none() {
        let mut first = mark("lego", 16, "standard", 1);
        let text = serde_json::to_string(&first).unwrap();
        assert!(!text.contains("timing"));
        assert_eq!(serde_json::from_str::<Mark>(&text).unwrap(), first);
        let id = first.id();
        first.timing = Some(timing("2026-01-01T00:00:00Z"));
        assert_eq!(first.id(), id, "when it was measured does not identify");
        Record::Mark(first.clone()).check().unwrap();
        let text = serde_json::to_string(&first).unwrap();
        assert_eq!(serde_json::from_str::<Mark>(&text).unwrap(), first);
    }
}
