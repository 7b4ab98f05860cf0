//! The one rule by which a mark is accepted when it is embedded, and by which a claim about it is judged.
use serde::{Deserialize, Serialize};

use crate::chance;
use crate::error::Result;
use crate::signed_rank;

/// How often a match may be claimed wrongly where nobody asks for another rate: 10^-6.
pub const DEFAULT_FALSE_POSITIVE_RATE: f64 = 1e-6;

/// What a reading says about a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The corrected p-value is at or below the rate.
    Match,
    /// It is above. This isn't "unmarked": marks can be too weak to be read, and other keys have other words.
    NoMatch,
    /// Whatever had been read, it could not have been a match; the reason says why.
    Inconclusive,
    /// There was nothing to compare with, since the key or the owner is unknown. Of claims only.
    UnknownKey,
}

/// A reading matches a message when the bits that agree, weighed by how clearly they were read, are so many that chance
/// explains it at most at this rate, the best of this many hypotheses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AcceptanceRule {
    /// A match is claimed wrongly at most so often, between 0 and 1.
    pub false_positive_rate: f64,
    /// Hypotheses that are tried: ways to read a suspect, times messages that it is compared with. None count as one.
    pub hypotheses: u64,
}

impl AcceptanceRule {
    /// The least rank sum of a match of `bits` bits ([`signed_rank`]); `None` when not even that of all bits would do.
    ///
    /// # Errors
    /// [`Error::Length`](crate::Error::Length) and [`Error::Rate`](crate::Error::Rate).
    pub fn least_rank_sum(&self, bits: u32) -> Result<Option<u32>> {
        signed_rank::least(bits, self.false_positive_rate, self.hypotheses)
    }

    /// Fewest of `bits` bits that would have to match if all were read equally clearly and merely counted; `None` when not
    /// even all would do. For marks that are to have something to spare, and not for claims.
    ///
    /// # Errors
    /// [`Error::Length`](crate::Error::Length) and [`Error::Rate`](crate::Error::Rate).
    pub fn least_matches(&self, bits: u32) -> Result<Option<u32>> {
        chance::least_matches(bits, self.false_positive_rate, self.hypotheses)
    }

    /// The probability that chance reaches `rank_sum` in any of the hypotheses, at most: to be compared with the rate.
    ///
    /// # Errors
    /// [`Error::Length`](crate::Error::Length).
    pub fn p_value(&self, bits: u32, rank_sum: u32) -> Result<f64> {
        Ok(chance::any_of(signed_rank::tail(bits, rank_sum)?, self.hypotheses))
    }

    /// What a rank sum of `bits` bits says.
    ///
    /// # Errors
    /// [`Error::Length`](crate::Error::Length) and [`Error::Rate`](crate::Error::Rate).
    pub fn verdict(&self, bits: u32, rank_sum: u32) -> Result<Verdict> {
        Ok(match self.least_rank_sum(bits)? {
            None => Verdict::Inconclusive,
            Some(needed) if rank_sum >= needed => Verdict::Match,
            Some(_) => Verdict::NoMatch,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Claim, HypothesisReading, MAX_BITS, Message, Scheme, Target};

    /// Logits of 64 bits with the ranks 1 to 64, all positive but those of the ranks that are given.
    fn logits(wrong: &[u32]) -> Vec<f32> {
        let sign = |rank: &u32| if wrong.contains(rank) { -1.0 } else { 1.0 };
        (1..=64).map(|rank| sign(&rank) * rank as f32).collect()
    }

    /// Ranks whose sum is `sum`, as few as there are.
    fn ranks_with(mut sum: u32) -> Vec<u32> {
        let mut ranks = Vec::new();
        for rank in (1..=64).rev() {
            if rank <= sum {
                ranks.push(rank);
                sum -= rank;
            }
        }
        assert_eq!(sum, 0);
        ranks
    }

    #[test]
    fn a_reading_that_just_meets_the_rule_is_a_match_as_a_claim_and_one_rank_less_is_not() {
        for (false_positive_rate, count) in [(1e-6, 178), (1e-6, 16), (1e-6, 1), (1e-9, 178), (1e-3, 5)] {
            let rule = AcceptanceRule {
                false_positive_rate,
                hypotheses: count,
            };
            let needed = rule.least_rank_sum(64).unwrap().unwrap();
            for (sum, verdict) in [(needed, Verdict::Match), (needed - 1, Verdict::NoMatch)] {
                let logits = logits(&ranks_with(signed_rank::largest(64) - sum));
                // All other ways of reading the suspect decide nothing.
                let readings: Vec<_> = (0..count)
                    .map(|place| HypothesisReading {
                        name: place.to_string(),
                        views: 1,
                        logits: if place == 0 { logits.clone() } else { vec![0.0; 64] },
                        tries: count,
                    })
                    .collect();
                let claim = Claim {
                    scheme: Scheme::default(),
                    readings: &readings,
                    targets: &[Target {
                        id: "asset".into(),
                        word: Message::from_u64(u64::MAX),
                        pad: None,
                    }],
                    targets_tried: None,
                    other_tries: 1,
                    rate: false_positive_rate,
                };
                let answer = claim.test().unwrap().answer;
                assert_eq!((answer.verdict, answer.needed_rank_sum), (verdict, Some(needed)));
                assert_eq!(rule.verdict(64, sum).unwrap(), verdict);
                let best = answer.best.unwrap();
                assert_eq!((best.rank_sum, best.p_value), (sum, rule.p_value(64, sum).unwrap()));
            }
        }
    }

    #[test]
    fn verdict_and_p_value_agree_for_all_lengths() {
        let rule = AcceptanceRule {
            false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
            hypotheses: 178,
        };
        for bits in 1..=MAX_BITS {
            for rank_sum in 0..=signed_rank::largest(bits) {
                let enough = rule.p_value(bits, rank_sum).unwrap() <= rule.false_positive_rate;
                assert_eq!(rule.verdict(bits, rank_sum).unwrap() == Verdict::Match, enough);
            }
        }
        // What the words of assets must reach in the mean picture to be handed out (docs/verify.md).
        assert_eq!(rule.least_matches(64).unwrap(), Some(55));
        assert_eq!(
            rule.verdict(16, signed_rank::largest(16)).unwrap(),
            Verdict::Inconclusive
        );
        assert!(rule.verdict(151, 151).is_err());
    }
}
