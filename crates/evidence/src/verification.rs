//! What a reading found: the verdict, the numbers behind it, and whose message it is.
use crate::history::History;
use crate::tried::Tried;
use guardsplat_codeword::{AcceptanceRule, Verdict, chance, signed_rank};
use serde::{Deserialize, Serialize};

/// The outcome of reading a suspect, or of reading back what was just marked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Verification {
    /// The outcome.
    pub verdict: Verdict,
    /// Why nothing could be decided; with [`Verdict::Inconclusive`] only, and then required.
    pub reason: Option<Reason>,
    /// What else the engine has to say, for people.
    pub note: Option<String>,
    /// What was tried.
    pub tried: Tried,
    /// Views or pictures that were read, pooled into one reading.
    pub views: u32,
    /// The numbers; absent where nothing was compared.
    pub decision: Option<Decision>,
    /// What was before; absent in reports of version 1, and of a marking.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub history: Option<History>,
    /// Whose it is; with [`Verdict::Match`] only.
    pub found: Option<Found>,
    /// The reading bit by bit, most significant first; empty, or one for each bit. For owners only.
    pub strip: Vec<Bit>,
}

/// Why nothing could be decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// No message was named to compare with.
    NothingToCompare,
    /// The key has so few bits that even a perfect reading stays above the threshold.
    TooFewBits,
    /// The bits would do for one hypothesis, and not for as many as were tried.
    TooManyHypotheses,
    /// The views contradict each other, or say next to nothing.
    WeakReading,
    /// The pictures are too few or too small to be read.
    TooLittleToRead,
    /// So many bits match that it would be a match, and a file of the suspect was seen before the asset was registered,
    /// when nobody could have marked it: the asset was chosen to fit, or chance did it. Not in version 1.
    RegisteredLater,
}

/// The numbers behind a verdict. Null hypothesis: the suspect is independent of the secret, uniform pad that the message
/// was whitened with, so that each bit matches as a thrown coin would, however clearly it was read. The test is Wilcoxon's
/// signed-rank test ([`signed_rank`]); before version 4 of reports matches were counted, and are Binomial(bits, 1/2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// Bits compared, 1 to 150.
    pub bits: u32,
    /// Bits that match.
    pub matched: u32,
    /// The sum of their ranks, of all bits ranked from 1 by the size of their logits; absent before version 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rank_sum: Option<u32>,
    /// Bits that the error-correcting code set right when the message was read; never part of the decision.
    pub corrected: Option<u32>,
    /// Hypotheses that were tried, at least 1.
    pub hypotheses: u64,
    /// The probability that chance reaches such a rank sum, 0 to 1: before the correction for several hypotheses. Before
    /// version 4 P(Binomial(bits, 1/2) ≥ matched).
    pub p_single: f64,
    /// The same after it: times `hypotheses`, at most 1.
    pub p_value: f64,
    /// A match needs a `p_value` at or below this rate of false positives, 0 to 1.
    pub threshold: f64,
    /// The rank sum that this needs, before version 4 the matches; absent when even all bits would not do.
    pub needed: Option<u32>,
}

/// How a report's decision came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Test {
    /// By the sum of the ranks of the bits that match.
    SignedRank(u32),
    /// By their number: before version 4.
    Counted,
}

impl Decision {
    /// The numbers that follow from `matched` of `bits` with the sum of their ranks, after so many hypotheses; of impossible
    /// ones, that nothing is shown.
    pub fn new(bits: u32, (matched, rank_sum): (u32, u32), hypotheses: u64, threshold: f64) -> Self {
        Self {
            bits,
            matched,
            rank_sum: Some(rank_sum),
            corrected: None,
            hypotheses,
            p_single: 1.0,
            p_value: 1.0,
            threshold,
            needed: None,
        }
        .computed()
    }

    /// This with all numbers that follow from others computed, as its version does it.
    pub(crate) fn computed(self) -> Self {
        let rule = AcceptanceRule {
            false_positive_rate: self.threshold,
            hypotheses: self.hypotheses,
        };
        let (p_single, needed) = match self.test() {
            Test::SignedRank(sum) => (signed_rank::tail(self.bits, sum), rule.least_rank_sum(self.bits)),
            Test::Counted => (chance::tail(self.bits, self.matched), rule.least_matches(self.bits)),
        };
        let p_single = p_single.unwrap_or(1.0);
        Self {
            p_single,
            p_value: chance::any_of(p_single, self.hypotheses),
            needed: needed.unwrap_or(None),
            ..self
        }
    }

    /// How it was decided.
    pub(crate) fn test(&self) -> Test {
        self.rank_sum.map_or(Test::Counted, Test::SignedRank)
    }

    /// What follows from these numbers: [`Verdict::Inconclusive`] where not even all bits would do.
    pub fn verdict(&self) -> Verdict {
        match self.needed {
            None => Verdict::Inconclusive,
            Some(_) if self.p_value <= self.threshold => Verdict::Match,
            Some(_) => Verdict::NoMatch,
        }
    }
}

/// Whose message was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// Who owns it.
    pub owner: String,
    /// What it was put into.
    pub asset: String,
    /// The payload in hexadecimal; for the owner only.
    pub payload: Option<String>,
}

/// One bit of a reading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bit {
    /// What the message would have there; absent without a claim.
    pub wanted: Option<bool>,
    /// What was read.
    pub read: bool,
    /// How sure the reading is, 0 (a coin) to 1.
    pub confidence: Option<f64>,
    /// The sum of the bit's logits over all views.
    pub logit: Option<f64>,
}
