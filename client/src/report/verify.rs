//! What was read of a suspect.
use guardsplat_proto::v1::VerifyResult;
use guardsplat_proto::v1::verify_result::Verdict;
use serde::Serialize;

use super::credentials::CredentialsReport;
use super::text::{rows_ignored, seconds, some, time, word};
use crate::output::{Exit, printable};

/// What came of a job that verified a suspect.
#[derive(Debug, Serialize)]
pub struct VerifyReport {
    verdict: String,
    p_value: Option<f64>,
    threshold: Option<f64>,
    matched_bits: Option<u32>,
    rank_sum: Option<u32>,
    needed_rank_sum: Option<u32>,
    bits: u32,
    views: u32,
    /// The message read; null for a claim, of which only the evidence has it.
    message: Option<String>,
    bit_accuracy: Option<f64>,
    bit_accuracy_worst_view: Option<f64>,
    mean_abs_logit: Option<f64>,
    view_agreement: Option<f64>,
    hypotheses: Option<u64>,
    framings: Option<u32>,
    assets: Option<u64>,
    framing: Option<String>,
    /// Of each picture how much of it the original explains, where one was given; null where it does not show its scene.
    explained_by_original: Vec<Option<f64>>,
    asset: Option<String>,
    owner: Option<String>,
    payload_number: Option<i64>,
    corrected_bits: Option<u32>,
    evidence_html: Option<String>,
    evidence_json: Option<String>,
    /// Of scenes that were marked with the mark that was found, newest first.
    credentials: Vec<CredentialsReport>,
    assets_paid: Option<u64>,
    readings_paid: Option<u64>,
    first_seen_time: Option<String>,
    asset_commit_time: Option<String>,
    asset_registered_later: bool,
    /// Whether what tells how near it was is left out, for who calls is no admin; such fields are null.
    redacted: bool,
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
            rank_sum: result.rank_sum,
            needed_rank_sum: result.needed_rank_sum,
            bits: result.bits,
            views: result.views,
            message: some(&result.message),
            bit_accuracy: result.bit_accuracy,
            bit_accuracy_worst_view: result.bit_accuracy_worst_view,
            mean_abs_logit: Some(result.mean_abs_logit).filter(|_| !result.redacted),
            view_agreement: Some(result.view_agreement).filter(|_| !result.redacted),
            hypotheses: result.hypotheses,
            // Of a raw message these two are not counted.
            framings: result.hypotheses.map(|_| result.framings),
            assets: result.hypotheses.map(|_| result.assets),
            assets_paid: Some(result.assets_paid).filter(|&assets| assets > 0),
            readings_paid: Some(result.readings_paid).filter(|&readings| readings > 0),
            first_seen_time: time(result.first_seen_time),
            asset_commit_time: time(result.asset_commit_time),
            asset_registered_later: result.asset_registered_later,
            redacted: result.redacted,
            framing: some(&result.framing),
            explained_by_original: result
                .explained_by_original
                .iter()
                .map(|&explained| Some(explained).filter(|&explained| explained > 0.0))
                .collect(),
            asset: some(&result.asset),
            owner: some(&result.owner),
            payload_number: result.payload_number,
            corrected_bits: result.corrected_bits,
            evidence_html: some(&result.evidence_html),
            evidence_json: some(&result.evidence_json),
            credentials: result.credentials.iter().map(Into::into).collect(),
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
        if self.redacted {
            return self.without_figures(verdict);
        }
        let read = format!(
            "read {} from {} views; views agree on {:.1} % of bits, mean logit {:.2}",
            printable(self.message.as_deref().unwrap_or_default()),
            self.views,
            100.0 * self.view_agreement.unwrap_or_default(),
            self.mean_abs_logit.unwrap_or_default()
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
        text + &self.beside_original() + &self.credentials_lines() + &rows_ignored(self.ignored_rows)
    }

    /// How many pictures show the scene of the original, where they were compared with one.
    fn beside_original(&self) -> String {
        match self.explained_by_original.len() {
            0 => String::new(),
            all => {
                let show = self.explained_by_original.iter().flatten().count();
                format!(
                    "\nthe original's scene was found in {show} of {}",
                    counted(all as u64, "picture", "pictures")
                )
            }
        }
    }

    fn credentials_lines(&self) -> String {
        self.credentials.iter().map(CredentialsReport::line).collect()
    }

    /// Of a raw verification, to who is no admin.
    fn without_figures(&self, mut text: String) -> String {
        if let Some(reason) = &self.reason {
            text = format!("{text}\n{}", printable(reason));
        }
        text + "\nhow near it was is told to admins" + &self.credentials_lines() + &rows_ignored(self.ignored_rows)
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
                ": {matched} of {} bits{}, p = {p:.2e} (threshold {threshold:e}) after {}: {}; {}, best {}",
                self.bits,
                corrected.unwrap_or_default(),
                counted(hypotheses, "hypothesis", "hypotheses"),
                self.tried(),
                counted(self.views.into(), "view", "views"),
                printable(self.framing.as_deref().unwrap_or_default())
            );
        }
        if self.redacted {
            // Of a match what the p-value is at most; of all else nothing.
            let p = self.p_value.map(|p| format!(", p <= {p:e}"));
            text += &format!(
                "{} after {}: {}",
                p.unwrap_or_default(),
                counted(hypotheses, "hypothesis", "hypotheses"),
                self.tried()
            );
        }
        if let Some(reason) = &self.reason {
            text = format!("{text}\n{}", printable(reason));
        }
        if self.asset_registered_later && self.reason.is_none() {
            text += "\nthe asset was registered after a file of the suspect was first seen, which can't carry its mark";
        }
        if self.redacted {
            text += "\nhow near it was, and the evidence, are for admins";
        }
        if let Some(evidence) = &self.evidence_html {
            text += &format!("\nevidence: {evidence}");
        }
        text + &self.beside_original() + &self.credentials_lines() + &rows_ignored(self.ignored_rows)
    }
}

impl VerifyReport {
    /// What the hypotheses are made of. Servers of before pay for what was compared, once.
    fn tried(&self) -> String {
        let framings = counted(self.framings.unwrap_or_default().into(), "framing", "framings");
        let compared = self.assets.unwrap_or_default();
        let assets = match self.assets_paid {
            Some(paid) if paid > compared => format!("{compared} of {}", counted(paid, "asset", "assets")),
            _ => counted(compared, "asset", "assets"),
        };
        let readings = self.readings_paid.filter(|&readings| readings > 1);
        let readings = readings.map(|readings| format!(", reading {readings} of these files"));
        format!("{framings}, {assets}{}", readings.unwrap_or_default())
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

    #[test]
    fn pictures_that_show_the_originals_scene_are_counted() {
        let told = |explained: Vec<f64>| {
            let result = VerifyResult {
                explained_by_original: explained,
                ..VerifyResult::default()
            };
            VerifyReport::from(&result).lines()
        };
        assert!(told(vec![0.97, 0.0]).ends_with("\nthe original's scene was found in 1 of 2 pictures"));
        assert!(told(vec![0.0]).ends_with("\nthe original's scene was found in 0 of 1 picture"));
        assert!(!told(Vec::new()).contains("original"));
    }
}
