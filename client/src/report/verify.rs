//! What was read of a suspect.
use guardsplat_proto::v1::VerifyResult;
use guardsplat_proto::v1::verify_result::Verdict;
use serde::Serialize;

use super::{rows_ignored, seconds, some, word};
use crate::output::{Exit, printable};

/// What came of a job that verified a suspect.
#[derive(Debug, Serialize)]
pub struct VerifyReport {
    verdict: String,
    p_value: Option<f64>,
    threshold: Option<f64>,
    matched_bits: Option<u32>,
    needed_bits: Option<u32>,
    bits: u32,
    views: u32,
    /// The message read.
    message: String,
    bit_accuracy: Option<f64>,
    bit_accuracy_worst_view: Option<f64>,
    mean_abs_logit: f64,
    view_agreement: f64,
    reason: Option<String>,
    ignored_rows: u64,
    seconds: f64,
    device: String,
    clip: String,
    #[serde(skip)]
    exit: Exit,
}

impl From<&VerifyResult> for VerifyReport {
    fn from(result: &VerifyResult) -> Self {
        Self {
            verdict: word(result.verdict().as_str_name(), "VERDICT_"),
            p_value: result.p_value,
            threshold: result.threshold,
            matched_bits: result.matched_bits,
            needed_bits: result.needed_bits,
            bits: result.bits,
            views: result.views,
            message: result.message.clone(),
            bit_accuracy: result.bit_accuracy,
            bit_accuracy_worst_view: result.bit_accuracy_worst_view,
            mean_abs_logit: result.mean_abs_logit,
            view_agreement: result.view_agreement,
            reason: some(&result.reason),
            ignored_rows: result.ignored_rows,
            seconds: seconds(result.duration),
            device: result.device.clone(),
            clip: result.clip.clone(),
            exit: match result.verdict() {
                Verdict::Match => Exit::Done,
                Verdict::NoMatch => Exit::NoMatch,
                Verdict::Inconclusive | Verdict::Unspecified => Exit::Inconclusive,
            },
        }
    }
}

impl VerifyReport {
    /// What the process exits with.
    pub fn exit(&self) -> Exit {
        self.exit
    }

    /// For people.
    pub fn lines(&self) -> String {
        let verdict = self.verdict.replace('_', " ");
        let read = format!(
            "read {} from {} views; views agree on {:.1} % of bits, mean logit {:.2}",
            printable(&self.message),
            self.views,
            100.0 * self.view_agreement,
            self.mean_abs_logit
        );
        let mut text = match (self.matched_bits, self.p_value, self.threshold) {
            (Some(matched), Some(p), Some(threshold)) => format!(
                "{verdict}: {matched} of {} bits, p = {p:.2e} (threshold {threshold:e}); {:.2} % of bits a view, worst \
                 {:.2} %; {read}",
                self.bits,
                100.0 * self.bit_accuracy.unwrap_or_default(),
                100.0 * self.bit_accuracy_worst_view.unwrap_or_default()
            ),
            _ => format!("{verdict}: {read}"),
        };
        if let Some(reason) = &self.reason {
            text.push('\n');
            text.push_str(&printable(reason));
        }
        text + &rows_ignored(self.ignored_rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_have_the_exit_codes_of_the_engine() {
        let exit = |verdict| {
            let mut result = VerifyResult::default();
            result.set_verdict(verdict);
            let report = VerifyReport::from(&result);
            (report.verdict.clone(), report.exit().code())
        };
        assert_eq!(exit(Verdict::Match), ("match".into(), 0));
        assert_eq!(exit(Verdict::NoMatch), ("no_match".into(), 2));
        assert_eq!(exit(Verdict::Inconclusive), ("inconclusive".into(), 3));
        assert_eq!(exit(Verdict::Unspecified).1, 3);
    }

    #[test]
    fn without_a_message_nothing_is_compared() {
        let mut result = VerifyResult {
            message: "c0ffee42".into(),
            bits: 32,
            views: 20,
            reason: "nothing to compare with".into(),
            ..VerifyResult::default()
        };
        result.set_verdict(Verdict::Inconclusive);
        let report = VerifyReport::from(&result);
        let text = report.lines();
        assert!(text.starts_with("inconclusive: read c0ffee42 from 20 views"), "{text}");
        assert!(text.ends_with("\nnothing to compare with"), "{text}");
        let json = serde_json::to_value(&report).unwrap();
        assert!(json["p_value"].is_null() && json.get("exit").is_none());
        assert_eq!(json["ignored_rows"], 0);
        result.ignored_rows = 3;
        let text = VerifyReport::from(&result).lines();
        assert!(text.ends_with("compare with\n3 rows ignored"), "{text}");
    }
}
