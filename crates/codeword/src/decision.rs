//! How sure a reading of one raw message is: the verdict of the [`AcceptanceRule`] with what it rests on.
//!
//! Under the null hypothesis each of the n bits matches with probability 1/2, independently, because whoever chose the
//! message drew it at random and kept it secret; so p is the tail of [`signed_rank`](crate::signed_rank). Pooled views are
//! one word, not more trials.
use serde::{Deserialize, Serialize};

use crate::acceptance::{AcceptanceRule, Verdict};
use crate::chance;
use crate::error::Result;
use crate::message::Message;
use crate::reading::Reading;

/// A verdict with what it rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The outcome.
    pub verdict: Verdict,
    /// Probability of at least as large a rank sum by chance, times the hypotheses tried, at most 1.
    pub p_value: f64,
    /// A match needs `p_value` at or below this.
    pub threshold: f64,
    /// Bits that match.
    pub matched_bits: u32,
    /// Bits compared.
    pub bits: u32,
    /// The sum of the ranks of the bits that match, of bits ranked by how clearly they were read.
    pub rank_sum: u32,
    /// The rank sum that a match needs; `None` when that of all bits would not do.
    pub needed_rank_sum: Option<u32>,
    /// Keys, crops and orientations that were tried to get here.
    pub hypotheses: u64,
    /// Why the reading cannot decide, when it cannot.
    pub reason: Option<String>,
}

impl AcceptanceRule {
    /// Decides whether a reading, the best of the hypotheses, is of a message.
    ///
    /// # Errors
    /// [`Error::OtherLength`](crate::Error::OtherLength) for a message of another length, and
    /// [`Error::Rate`](crate::Error::Rate).
    pub fn decide(&self, reading: &Reading, message: &Message) -> Result<Decision> {
        let (bits, rank_sum) = (message.length().bits(), reading.rank_sum(message)?);
        let needed_rank_sum = self.least_rank_sum(bits)?;
        let (verdict, reason) = match needed_rank_sum {
            None => (Verdict::Inconclusive, Some(self.cannot_decide(bits)?)),
            Some(needed) if reading.largest_rank_sum() < needed => {
                let reason = too_few_decided(reading.decided_bits(), bits);
                (Verdict::Inconclusive, Some(reason))
            }
            Some(_) => (self.verdict(bits, rank_sum)?, None),
        };
        Ok(Decision {
            verdict,
            p_value: self.p_value(bits, rank_sum)?,
            threshold: self.false_positive_rate,
            matched_bits: reading.matches(message)?,
            bits,
            rank_sum,
            needed_rank_sum,
            hypotheses: self.hypotheses.max(1),
            reason,
        })
    }

    fn cannot_decide(&self, bits: u32) -> Result<String> {
        let (hypotheses, threshold) = (self.hypotheses.max(1), self.false_positive_rate);
        let p = chance::reachable_rate(bits, hypotheses)?;
        Ok(format!(
            "{bits} bits tried {hypotheses} times can never reach p <= {threshold:e}: all of them match by chance with \
             p = {p:.1e}"
        ))
    }
}

/// Why a reading that leaves many bits undecided decides nothing.
pub(crate) fn too_few_decided(decided: u32, bits: u32) -> String {
    format!("at most {decided} of {bits} bits could be decided: were all of them right, it would be no match")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DEFAULT_FALSE_POSITIVE_RATE, signed_rank};

    /// The decision on a reading of which so many bits match, the clearest of them.
    fn decide(bits: usize, matched: usize, hypotheses: u64) -> Decision {
        let rule = AcceptanceRule {
            false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
            hypotheses,
        };
        let message = Message::from_bits(&vec![true; bits]).unwrap();
        let logits: Vec<f32> = (0..bits).map(|bit| if bit < matched { 1.0 } else { -0.5 }).collect();
        rule.decide(&Reading::from_logits(&logits).unwrap(), &message).unwrap()
    }

    #[test]
    fn the_longest_messages_are_judged_too() {
        let best = decide(150, 150, 1);
        assert_eq!((best.verdict, best.p_value), (Verdict::Match, 2_f64.powi(-150)));
        assert_eq!(decide(150, 60, 1).verdict, Verdict::NoMatch);
    }

    #[test]
    fn bits_that_were_hardly_read_may_be_wrong() {
        // The seven least clear of 32: their ranks are 28 of 528. Counted alike, 30 would have to match.
        let enough = decide(32, 25, 1);
        assert_eq!(
            (enough.verdict, enough.rank_sum, enough.matched_bits),
            (Verdict::Match, 500, 25)
        );
        let miss = decide(32, 22, 1);
        assert_eq!(
            (miss.verdict, miss.rank_sum, miss.reason),
            (Verdict::NoMatch, 473, None)
        );
        // Not so if they were the clearest.
        let message = Message::from_bits(&[true; 32]).unwrap();
        let logits: Vec<f32> = (0..32).map(|bit| if bit < 25 { 0.5 } else { -1.0 }).collect();
        let rule = AcceptanceRule {
            false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
            hypotheses: 1,
        };
        let stubborn = rule.decide(&Reading::from_logits(&logits).unwrap(), &message).unwrap();
        assert_eq!((stubborn.verdict, stubborn.rank_sum), (Verdict::NoMatch, 325));
    }

    #[test]
    fn hypotheses_multiply_the_p_value() {
        let many = decide(32, 25, 100);
        assert!(many.needed_rank_sum > decide(32, 25, 1).needed_rank_sum);
        assert!((many.p_value - 100.0 * signed_rank::tail(32, 500).unwrap()).abs() < 1e-18);
        assert_eq!(decide(32, 0, 10).p_value, 1.0);
        assert_eq!(decide(32, 32, u32::MAX.into()).verdict, Verdict::Inconclusive);
    }

    #[test]
    fn sixteen_bits_are_inconclusive_and_say_why() {
        for matched in [8, 16] {
            let short = decide(16, matched, 1);
            assert_eq!(short.verdict, Verdict::Inconclusive);
            assert!(short.reason.unwrap().contains("can never reach p <= 1e-6"));
        }
    }

    #[test]
    fn readings_that_say_nothing_are_inconclusive() {
        let rule = AcceptanceRule {
            false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
            hypotheses: 1,
        };
        let message = Message::from_u64(5);
        let none = rule
            .decide(&Reading::from_logits(&[0.0; 64]).unwrap(), &message)
            .unwrap();
        assert_eq!(
            (none.verdict, none.matched_bits, none.p_value),
            (Verdict::Inconclusive, 0, 1.0)
        );
        assert!(none.reason.unwrap().contains("at most 0 of 64 bits could be decided"));
        assert!(
            rule.decide(&Reading::from_logits(&[1.0; 63]).unwrap(), &message)
                .is_err()
        );
    }

    #[test]
    fn verdicts_are_snake_case_in_json() {
        let json = serde_json::to_value(decide(32, 16, 1)).unwrap();
        assert_eq!(json["verdict"], "no_match");
    }
}
