//! What a marked scene must reach to be handed out, by the length of its message.
//!
//! A message of up to 32 bits is compared bit by bit by whoever gave it, so all of it must be read. Longer ones are the
//! words of assets, or compared with a claim, and a claim wants many bits and not all of them. So the scene as a claim
//! renders it must match by the rule of claims, under whatever hypothesis it is read; and in the mean picture so many bits
//! must be right that it would match were they merely counted, which leaves a claim something to spare.
//! Whether the code of words reads its payload as well (up to 5 bits of 64 wrong) decides nothing: no claim rests on it.
use guardsplat_codeword::{AcceptanceRule, Decision, Verdict};
use serde::{Deserialize, Serialize};

use super::verify::Verification;
use crate::quality::Quality;

/// Messages up to here must be right to the last bit.
const SHORT: usize = 32;

/// A mark that is this much too strong at most is made weaker, dB.
const WEAKENED_DB: f64 = 2.5;
/// And by so much more than is missing: 8-bit pictures do not follow a factor exactly.
const SPARE_DB: f64 = 0.03;

/// What a marked scene must reach to be written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Mean bit accuracy on held-out views; beyond 32 bits no more than what a claim about a picture needs.
    pub bit_accuracy: f64,
    /// Mean PSNR on held-out views, dB.
    pub psnr_db: f64,
    /// Mean PSNR over the pixels that the scene covers, dB; `None` for whatever it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr_covered_db: Option<f64>,
    /// Whether the message must be read: up to 32 bits all of it, from [`Verify::message_views`](super::Verify::message_views)
    /// views; beyond, so well from all views that a claim about a picture is a match.
    pub message: bool,
}

impl Target {
    /// The mean bit accuracy that is wanted of a message of so many bits.
    pub fn wanted(&self, bits: usize, rule: &AcceptanceRule) -> f64 {
        let enough = needed(bits, rule) as f64 / bits.max(1) as f64;
        match bits {
            ..=SHORT => self.bit_accuracy,
            _ => self.bit_accuracy.min(enough),
        }
    }

    /// Whether a mark shows more than it may, by the likeness of pictures as a whole or over what the scene covers.
    pub(super) fn is_too_visible(&self, quality: &Quality, psnr_covered_db: Option<f64>) -> bool {
        let below = |found: Option<f64>, wanted: Option<f64>| matches!((found, wanted), (Some(f), Some(w)) if f < w);
        below(quality.psnr.psnr_db, Some(self.psnr_db)) || below(psnr_covered_db, self.psnr_covered_db)
    }

    /// What a mark's changes are to be multiplied by where held-out views show it a little more than they may: they are other
    /// views than those whose PSNR was held, and a scene is to be handed out that is a hundredth of a dB short. `None` where
    /// they show it as little as they may, or so much more that what is left would hardly be read.
    pub fn weaken(&self, found: &Verification) -> Option<f32> {
        let whole = self.psnr_db - found.quality.psnr.psnr_db?;
        let short = self.short_over_covered(found).map_or(whole, |short| whole.max(short));
        // A difference that is smaller by a factor has a PSNR that is higher by twenty times its logarithm.
        (short > 0.0 && short <= WEAKENED_DB).then(|| 10_f64.powf(-(short + SPARE_DB) / 20.0) as f32)
    }

    /// dB that are missing over covered pixels; negative where there are more than are wanted.
    fn short_over_covered(&self, found: &Verification) -> Option<f64> {
        Some(self.psnr_covered_db? - found.psnr_covered_db?)
    }

    /// What a verification misses, in words; nothing when all is reached. A message of more than 32 bits must be read well
    /// enough for a claim that is judged by `rule`.
    pub fn missed(&self, found: &Verification, rule: &AcceptanceRule) -> Vec<String> {
        let mut missed = Vec::new();
        let bits = found.message.len();
        let (accuracy, wanted) = (found.comparison.bit_accuracy, self.wanted(bits, rule));
        if accuracy < wanted {
            missed.push(format!("bit accuracy {accuracy:.4} is below {wanted:.3}"));
        }
        if let Some(psnr) = found.quality.psnr.psnr_db
            && psnr < self.psnr_db
        {
            missed.push(format!("PSNR {psnr:.2} dB is below {} dB", self.psnr_db));
        }
        if let (Some(wanted), Some(short)) = (self.psnr_covered_db, self.short_over_covered(found))
            && short > 0.0
        {
            let psnr = wanted - short;
            missed.push(format!(
                "PSNR over what the scene covers, {psnr:.2} dB, is below {wanted} dB"
            ));
        }
        if self.message && bits <= SHORT && found.wrong_bits > 0 {
            // How many, and not which: the words of assets are told to nobody.
            missed.push(format!("{} of {bits} bits of the message are wrong", found.wrong_bits));
        }
        let claimed = bits > SHORT || found.comparison.decision.bits as usize > bits;
        if self.message && claimed && !claimable(&found.comparison.decision, rule) {
            missed.push(format!(
                "a claim would be no match: {} of {bits} bits of the message are wrong",
                found.wrong_bits_of_all
            ));
        }
        missed
    }
}

/// Whether a claim about the scene would be a match; where none could be, whether all bits are right.
fn claimable(decision: &Decision, rule: &AcceptanceRule) -> bool {
    match rule.verdict(decision.bits, decision.rank_sum) {
        Ok(Verdict::Inconclusive) | Err(_) => decision.matched_bits == decision.bits,
        Ok(verdict) => verdict == Verdict::Match,
    }
}

/// Bits of so many that must match: all of a short message, and of others what a claim would need that counted them.
fn needed(bits: usize, rule: &AcceptanceRule) -> usize {
    let claimed = |bits: usize| rule.least_matches(bits as u32).ok().flatten();
    match bits {
        ..=SHORT => bits,
        _ => claimed(bits).map_or(bits, |needed| needed as usize),
    }
}

#[cfg(test)]
mod tests {
    use guardsplat_codeword::{
        Claim, DEFAULT_FALSE_POSITIVE_RATE, HypothesisReading, Message, Reading, Scheme, Target as Claimed, Verdict,
    };

    use super::*;

    /// As many hypotheses as the shipped CLIP searches in a picture; `searched_hypotheses` is tested to be so many.
    const RULE: AcceptanceRule = AcceptanceRule {
        false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
        hypotheses: 178,
    };

    #[test]
    fn short_messages_must_be_right_and_long_ones_claimable() {
        let target = Target {
            bit_accuracy: 0.95,
            psnr_db: 37.5,
            psnr_covered_db: None,
            message: true,
        };
        let wanted = |bits| (target.wanted(bits, &RULE), needed(bits, &RULE));
        assert_eq!(wanted(32), (0.95, 32));
        assert_eq!(wanted(8), (0.95, 8));
        // 55 of 64 would be a match if all bits were read alike.
        assert_eq!(wanted(64), (55.0 / 64.0, 55));
        assert!(wanted(128).0 < wanted(64).0 && wanted(128).0 > 0.7);
        // A target that asks for less is not raised.
        let low = Target {
            bit_accuracy: 0.6,
            ..target
        };
        assert_eq!(low.wanted(64, &RULE), 0.6);
        // A stricter rate asks for more.
        let strict = AcceptanceRule {
            false_positive_rate: 1e-12,
            ..RULE
        };
        assert!(needed(64, &strict) > 55);
    }

    #[test]
    fn a_mark_is_claimable_where_a_claim_about_it_is_a_match() {
        let word = Message::from_u64(u64::MAX);
        let mut found = Vec::new();
        for rule in [1e-6, 1e-9, 1e-3].map(|false_positive_rate| AcceptanceRule {
            false_positive_rate,
            ..RULE
        }) {
            for wrong in 15..30 {
                // The least clear bits are wrong.
                let logits: Vec<f32> = (0..64).map(|bit| if bit < wrong { -0.5 } else { 1.0 }).collect();
                let best = HypothesisReading {
                    name: "as given".into(),
                    views: 1,
                    logits: logits.clone(),
                    tries: rule.hypotheses,
                };
                // Other hypotheses read nothing, and are paid for.
                let none = HypothesisReading {
                    logits: vec![0.0; 64],
                    ..best.clone()
                };
                let mut readings = vec![none; rule.hypotheses as usize];
                readings[0] = best;
                let claim = Claim {
                    scheme: Scheme::default(),
                    readings: &readings,
                    targets: &[Claimed {
                        id: "asset".into(),
                        word,
                        pad: None,
                    }],
                    targets_tried: None,
                    other_tries: 1,
                    rate: rule.false_positive_rate,
                };
                let alone = AcceptanceRule { hypotheses: 1, ..rule };
                let decision = alone.decide(&Reading::from_logits(&logits).unwrap(), &word).unwrap();
                let matches = claim.test().unwrap().answer.verdict == Verdict::Match;
                assert_eq!(claimable(&decision, &rule), matches, "{wrong}");
                found.push(matches);
            }
        }
        assert!(found.contains(&true) && found.contains(&false));
        // Where no claim could be a match, all bits must be right.
        let short = Message::parse("3ffff", 18).unwrap();
        for (logit, right) in [(1.0, true), (-1.0, false)] {
            let mut logits = [1.0; 18];
            logits[0] = logit;
            let decision = RULE.decide(&Reading::from_logits(&logits).unwrap(), &short).unwrap();
            assert_eq!(claimable(&decision, &RULE), right);
        }
    }
}
