//! What a claim is answered with.
use serde::{Deserialize, Serialize};

use crate::acceptance::Verdict;
use crate::code::Payload;
use crate::message::Message;
use crate::reading::Reading;

/// A verdict with what it rests on.
///
/// Matches and p-values tell whoever may ask again how near they are: strangers should be given the verdict only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The outcome.
    pub verdict: Verdict,
    /// The false-positive rate asked for; the threshold of [`Comparison::p_value`].
    pub rate: f64,
    /// Bits of a word.
    pub bits: u32,
    /// The rank sum that the rate needs with so many hypotheses; `None` when that of all bits would not do.
    pub needed_rank_sum: Option<u32>,
    /// Hypotheses that the best reading pays for: its `tries` times targets times other tries.
    pub hypotheses: u64,
    /// The best hypothesis; `None` when nothing was compared.
    pub best: Option<Comparison>,
    /// What the mark says: for a match of a coded scheme whose target came with its pad.
    pub payload: Option<ReadPayload>,
    /// Why nothing could be decided, when it could not.
    pub reason: Option<String>,
}

/// The reading and the target with the least p-value; of equal ones the first reading, then the first target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The reading's name: what was undone before.
    #[serde(rename = "framing")]
    pub hypothesis: String,
    /// Views whose logits were summed.
    pub views: u32,
    /// The target's id.
    pub target: String,
    /// Bits that match.
    pub matched_bits: u32,
    /// Bits that no logit spoke for. They count as not matching.
    pub undecided_bits: u32,
    /// The sum of their ranks, of bits ranked by how clearly they were read ([`signed_rank`](crate::signed_rank)).
    pub rank_sum: u32,
    /// The probability that chance reaches that: the p-value if this were the only hypothesis.
    pub p_alone: f64,
    /// The p-value: that, times the hypotheses that this reading pays for, at most 1.
    pub p_value: f64,
}

/// What error correction made of a match.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum ReadPayload {
    /// A payload.
    Read {
        /// What it says.
        payload: Payload,
        /// Bits that were read wrong.
        corrected_bits: u32,
        /// Undecided bits that were filled in.
        filled_bits: u32,
        /// Whether the target's own word says the same. If not, too many bits were wrong for the code; the match stands.
        as_registered: bool,
    },
    /// None: the match stands, and the registry knows what the target says.
    Unreadable {
        /// Why.
        reason: String,
    },
}

/// How sure the bits of the best reading are. For the mark's owner only: whoever can ask for it learns, bit by bit, which
/// changes to a picture weaken the mark. That is why it is no part of [`Answer`] and is not serialised along with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confidences {
    /// The word read; undecided bits are 0.
    pub word: Message,
    /// tanh(|logit| / 2) a bit, 0 to 1: how far sigmoid(logit) is from undecided. A probability (twice that of being
    /// right, less one) only if the decoder is calibrated, which summed views are not.
    pub bits: Vec<f32>,
}

/// An answer for everybody who may ask, and what only the owner is given.
#[derive(Clone, Debug, PartialEq)]
pub struct Tested {
    /// The answer.
    pub answer: Answer,
    /// For the owner; `None` when nothing was compared.
    pub confidences: Option<Confidences>,
}

impl Confidences {
    pub(super) fn of(reading: &Reading, logits: &[f32]) -> Self {
        let sure = |&logit: &f32| {
            if logit.is_nan() {
                0.0
            } else {
                (logit.abs() / 2.0).tanh()
            }
        };
        Self {
            word: reading.message(),
            bits: logits.iter().map(sure).collect(),
        }
    }
}
