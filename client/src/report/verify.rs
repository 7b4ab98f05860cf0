//! What was read of a suspect.
use guardsplat_proto::v1::VerifyResult;
use guardsplat_proto::v1::verify_result::Verdict;
use serde::Serialize;

use super::text::{rows_ignored, seconds, some, word};
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
    /// The message read; null for a claim, of which only the evidence has it.
    message: Option<String>,
    bit_accuracy: Option<f64>,
    bit_accuracy_worst_view: Option<f64>,
    mean_abs_logit: f64,
    view_agreement: f64,
    hypotheses: Option<u64>,
    framings: Option<u32>,
    assets: Option<u64>,
    framing: Option<String>,
    asset: Option<String>,
    owner: Option<String>,
    payload_number: Option<i64>,
    corrected_bits: Option<u32>,
    evidence_html: Option<String>,
    evidence_json: Option<String>,
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
            message: some(&result.message),
            bit_accuracy: result.bit_accuracy,
            bit_accuracy_worst_view: result.bit_accuracy_worst_view,
            mean_abs_logit: result.mean_abs_logit,
            view_agreement: result.view_agreement,
            hypotheses: result.hypotheses,
            // Of a raw message these two are not counted.
            framings: result.hypotheses.map(|_| result.framings),
            assets: result.hypotheses.map(|_| result.assets),
            framing: some(&result.framing),
            asset: some(&result.asset),
            owner: some(&result.owner),
            payload_number: result.payload_number,
            corrected_bits: result.corrected_bits,
            evidence_html: some(&result.evidence_html),
            evidence_json: some(&result.evidence_json),
            reason: some(&result.reason),
            ignored_rows: result.ignored_rows,
            seconds: seconds(result.duration),
            device: result.device.clone(),
            clip: result.clip.clone(),
            exit: match result.verdict() {
                Verdict::Match => Exit::Done,
                Verdict::NoMatch => Exit::NoMatch,
                Verdict::Inconclusive | Verdict::UnknownKey | Verdict::Unspecified => Exit::Inconclusive,
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
        if let Some(hypotheses) = self.hypotheses {
            return self.claim(&verdict, hypotheses);
        }
        let read = format!(
            "read {} from {} views; views agree on {:.1} % of bits, mean logit {:.2}",
            printable(self.message.as_deref().unwrap_or_default()),
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

    /// Of a claim: whose mark it is, and what was tried to find it.
    fn claim(&self, verdict: &str, hypotheses: u64) -> String {
        let mut text = verdict.to_owned();
        if let (Some(asset), Some(owner)) = (&self.asset, &self.owner) {
            text += &format!(" with {} of {}", printable(asset), printable(owner));
        }
        if let (Some(matched), Some(p), Some(threshold)) = (self.matched_bits, self.p_value, self.threshold) {
            let corrected = self.corrected_bits.map(|bits| format!(", {bits} corrected"));
            text += &format!(
                ": {matched} of {} bits{}, p = {p:.2e} (threshold {threshold:e}) after {}: {}, {}; {}, best \
                 {}",
                self.bits,
                corrected.unwrap_or_default(),
                counted(hypotheses, "hypothesis", "hypotheses"),
                counted(self.framings.unwrap_or_default().into(), "framing", "framings"),
                counted(self.assets.unwrap_or_default(), "asset", "assets"),
                counted(self.views.into(), "view", "views"),
                printable(self.framing.as_deref().unwrap_or_default())
            );
        }
        if let Some(reason) = &self.reason {
            text = format!("{text}\n{}", printable(reason));
        }
        if let Some(evidence) = &self.evidence_html {
            text += &format!("\nevidence: {evidence}");
        }
        text + &rows_ignored(self.ignored_rows)
    }
}

/// A number with its noun.
fn counted(number: u64, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
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
        assert_eq!(exit(Verdict::UnknownKey), ("unknown_key".into(), 3));
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
