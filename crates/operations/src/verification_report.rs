//! What users are told of a verification: the fields of its JSON.
use guardsplat_codeword::{Hypothesis, MessageCode, Verdict};
use guardsplat_engine::Result;
use guardsplat_engine::extract::{Comparison, PooledLogits};
use guardsplat_engine::scene::Ignored;
use serde::Serialize;

use super::comparison::Compared;

/// Why a reading that has nothing to be compared with decides nothing.
const NOTHING_TO_COMPARE: &str = "any scene reads as some message; one to compare with decides";

/// The outcome, with the names of the program's JSON.
#[derive(Serialize)]
pub struct VerificationReport {
    /// Whether the message is there.
    pub verdict: Verdict,
    /// Probability that bits match as well by chance.
    pub p_value: Option<f64>,
    /// A match needs a p-value at or below this.
    pub threshold: Option<f64>,
    /// Bits that match.
    pub matched_bits: Option<u32>,
    /// The sum of their ranks, of bits ranked by how clearly they were read.
    pub rank_sum: Option<u32>,
    /// The rank sum that a match needs.
    pub needed_rank_sum: Option<u32>,
    /// Bits compared: of the word that a message is put into.
    pub bits: usize,
    /// Views or pictures read.
    pub views: usize,
    /// The message read.
    pub message: String,
    /// Mean share of bits of a view that match.
    pub bit_accuracy: Option<f64>,
    /// The same of the worst view.
    pub bit_accuracy_worst_view: Option<f64>,
    /// Mean distance of the bits' logits from the threshold.
    pub mean_abs_logit: f64,
    /// Mean share of views that agree with the decision on a bit.
    pub view_agreement: f64,
    /// Ways in which pictures were looked at, each of which the p-value pays for.
    #[serde(rename = "framings")]
    pub hypotheses: usize,
    /// The way that agreed best, where it is not the first: what was undone, whether borders were cut off.
    #[serde(rename = "framing")]
    pub hypothesis: Option<String>,
    /// What is estimated to have been done to each picture, where that was estimated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub estimates: Vec<String>,
    /// Of each picture the share of it that the original explains, where it was compared with one; nothing where it does not
    /// show the original's scene.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub explained_by_original: Vec<Option<f64>>,
    /// Rows of the scene that are no Gaussians of it and were ignored.
    pub ignored_rows: usize,
    /// Why nothing could be decided.
    pub reason: Option<String>,
}

impl VerificationReport {
    /// What a comparison says.
    pub fn of(code: &MessageCode, compared: &Compared) -> Result<Self> {
        let found = Self::new(code, &compared.reading, compared.comparison.as_ref(), &compared.ignored)?;
        Ok(Self {
            hypotheses: compared.ways,
            hypothesis: (compared.way != Hypothesis::default()).then(|| compared.way.to_string()),
            explained_by_original: compared.explained.clone(),
            estimates: compared.estimates.clone(),
            ..found
        })
    }

    /// What a reading and its comparison with a claimed message, if there was one, say; and how many rows of the scene
    /// were ignored for it.
    pub fn new(
        code: &MessageCode,
        reading: &PooledLogits,
        comparison: Option<&Comparison>,
        ignored: &[Ignored],
    ) -> Result<Self> {
        let decision = comparison.map(|c| &c.decision);
        Ok(Self {
            verdict: decision.map_or(Verdict::Inconclusive, |d| d.verdict),
            p_value: decision.map(|d| d.p_value),
            threshold: decision.map(|d| d.threshold),
            matched_bits: decision.map(|d| d.matched_bits),
            rank_sum: decision.map(|d| d.rank_sum),
            needed_rank_sum: decision.and_then(|d| d.needed_rank_sum),
            bits: reading.summed.len(),
            views: reading.views.len(),
            message: code.read(&reading.summed)?.to_string(),
            bit_accuracy: comparison.map(|c| c.bit_accuracy),
            bit_accuracy_worst_view: comparison.map(|c| c.bit_accuracy_worst_view),
            mean_abs_logit: reading.mean_abs_logit(),
            view_agreement: reading.agreement(),
            hypotheses: 1,
            hypothesis: None,
            estimates: Vec::new(),
            explained_by_original: Vec::new(),
            ignored_rows: ignored.iter().map(Ignored::count).sum(),
            reason: match decision {
                Some(decision) => decision.reason.clone(),
                None => Some(NOTHING_TO_COMPARE.into()),
            },
        })
    }
}

/// The whole of it, with what a verification was done with.
#[derive(Serialize)]
pub struct VerifyReport<'a> {
    /// What was found.
    #[serde(flatten)]
    pub findings: VerificationReport,
    /// How long it took, loading included.
    pub seconds: f64,
    /// Where it was computed.
    pub device: &'a str,
    /// The key's CLIP.
    pub clip: &'a str,
    /// The logits of every view or picture, a number a bit, positive for 1, where they are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub logits: Option<&'a [Vec<f32>]>,
}
