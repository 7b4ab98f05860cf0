//! Logits summed per bit over views, and the one reading that they decide for.
use guardsplat_codeword::{AcceptanceRule, Decision, Message, MessageCode, Reading};

use crate::error::{Error, Result};

/// Logits of some views of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct PooledLogits {
    /// Logits of each view, `bits` a view.
    pub views: Vec<Vec<f32>>,
    /// Their sum over the views, a bit.
    pub summed: Vec<f32>,
    /// What the sums decide for.
    reading: Reading,
}

/// How a reading compares with a message that was claimed.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The decision on the summed logits. Views are one reading, never independent trials.
    pub decision: Decision,
    /// Mean over views of the share of right bits.
    pub bit_accuracy: f64,
    /// The share of right bits of the worst view.
    pub bit_accuracy_worst_view: f64,
}

impl PooledLogits {
    /// Sums the logits of views.
    ///
    /// # Errors
    /// No views, views of different lengths, more bits than a message has, or logits that are not finite.
    pub fn new(views: Vec<Vec<f32>>) -> Result<Self> {
        let bad = |reason: String| Err(Error::BadOption { field: "views", reason });
        let Some(bits) = views.first().map(Vec::len).filter(|bits| *bits > 0) else {
            return bad("there is nothing to read".into());
        };
        let mut summed = vec![0.0_f32; bits];
        for (index, view) in views.iter().enumerate() {
            if view.len() != bits {
                return bad(format!("view {index} has {} bits, not {bits}", view.len()));
            }
            if let Some(value) = view.iter().find(|v| !v.is_finite()) {
                return bad(format!("a logit of view {index} is {value}"));
            }
            summed.iter_mut().zip(view).for_each(|(sum, v)| *sum += v);
        }
        Ok(Self {
            reading: Reading::from_logits(&summed)?,
            views,
            summed,
        })
    }

    /// The first `count` views only, all of them if there are fewer.
    ///
    /// # Errors
    /// When `count` is 0.
    pub fn of_first(&self, count: usize) -> Result<Self> {
        Self::new(self.views[..count.min(self.views.len())].to_vec())
    }

    /// What the summed logits decide for, with bits that they leave undecided.
    pub fn reading(&self) -> &Reading {
        &self.reading
    }

    /// Compares with a message of `code`, by a rule that says how many hypotheses are tried. The decision is on the bits of
    /// its word; right bits are those of the message.
    ///
    /// # Errors
    /// When lengths differ.
    pub fn compare(&self, code: &MessageCode, message: &Message, rule: &AcceptanceRule) -> Result<Comparison> {
        let word = code.word(message)?;
        if word.len() != self.summed.len() {
            return Err(Error::BadOption {
                field: "message",
                reason: format!("{} bits, but the key has {}", word.len(), self.summed.len()),
            });
        }
        let bits = message.len() as f64;
        let accuracies = self
            .views
            .iter()
            .map(|view| Ok(1.0 - f64::from(code.wrong_bits(view, message)?) / bits))
            .collect::<Result<Vec<f64>>>()?;
        Ok(Comparison {
            decision: rule.decide(&self.reading, &word)?,
            bit_accuracy: accuracies.iter().sum::<f64>() / accuracies.len() as f64,
            bit_accuracy_worst_view: accuracies.iter().copied().fold(1.0, f64::min),
        })
    }

    /// Mean size of a view's logits.
    pub fn mean_abs_logit(&self) -> f64 {
        let all = self.views.iter().flatten();
        let count = self.views.len() * self.summed.len();
        all.map(|v| f64::from(v.abs())).sum::<f64>() / count as f64
    }

    /// Share of a view's bits that agree with the summed decision, mean over views; 0.5 is chance for many views. Undecided
    /// bits agree with nothing.
    pub fn agreement(&self) -> f64 {
        let agreeing = |view: &Vec<f32>| {
            let pairs = view.iter().zip(&self.summed);
            pairs
                .filter(|(v, sum)| (**v > 0.0 && **sum > 0.0) || (**v < 0.0 && **sum < 0.0))
                .count()
        };
        let count = self.views.len() * self.summed.len();
        self.views.iter().map(agreeing).sum::<usize>() as f64 / count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use guardsplat_codeword::{Claim, DEFAULT_FALSE_POSITIVE_RATE, HypothesisReading, Scheme, Target, Verdict};

    const RULE: AcceptanceRule = AcceptanceRule {
        false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
        hypotheses: 1,
    };

    fn reading() -> PooledLogits {
        PooledLogits::new(vec![
            vec![3.0, -1.0, 0.5, -0.5],
            vec![-1.0, -1.0, 0.5, 0.25],
            vec![-1.0, -1.0, 0.5, 0.125],
        ])
        .unwrap()
    }

    #[test]
    fn logits_are_summed_and_votes_are_not_counted() {
        let reading = reading();
        assert_eq!(reading.summed, [1.0, -3.0, 1.5, -0.125]);
        // Two of three views vote against the first and the last bit; the sums decide otherwise.
        assert_eq!(reading.reading().message().to_string(), "a");
        assert_eq!(reading.of_first(1).unwrap().summed, [3.0, -1.0, 0.5, -0.5]);
        assert_eq!(reading.of_first(9).unwrap(), reading);
    }

    #[test]
    fn accuracy_is_per_view_and_the_decision_is_one() {
        let message = Message::parse("a", 4).unwrap();
        let found = reading().compare(&MessageCode::Plain, &message, &RULE).unwrap();
        assert_eq!(found.decision.matched_bits, 4);
        assert_eq!(found.decision.bits, 4);
        assert_eq!(found.decision.verdict, Verdict::Inconclusive);
        assert!((found.bit_accuracy - (1.0 + 0.5 + 0.5) / 3.0).abs() < 1e-12);
        assert_eq!(found.bit_accuracy_worst_view, 0.5);
        assert!(
            reading()
                .compare(&MessageCode::Plain, &Message::parse("aa", 8).unwrap(), &RULE)
                .is_err()
        );
    }

    #[test]
    fn coded_messages_are_compared_by_their_words_and_read_by_the_likeliest() {
        let code = MessageCode::coded(16, 77).unwrap();
        let message = Message::parse("c0de", 16).unwrap();
        let word = code.word(&message).unwrap();
        // Twelve bits of a view are wrong, others in each.
        let view = |first: usize| -> Vec<f32> {
            let signed = word.targets().map(|target| 2.0 * target - 1.0).enumerate();
            signed
                .map(|(i, v)| if (first..first + 12).contains(&i) { -0.5 * v } else { v })
                .collect()
        };
        let read = PooledLogits::new(vec![view(0), view(20), view(40)]).unwrap();
        let found = read.compare(&code, &message, &RULE).unwrap();
        assert_eq!((found.bit_accuracy, found.bit_accuracy_worst_view), (1.0, 1.0));
        assert_eq!((found.decision.matched_bits, found.decision.bits), (64, 64));
        assert_eq!(found.decision.verdict, Verdict::Match);
        let other = Message::parse("c0df", 16).unwrap();
        let found = read.compare(&code, &other, &RULE).unwrap();
        assert_eq!(
            (found.bit_accuracy, found.decision.verdict),
            (15.0 / 16.0, Verdict::NoMatch)
        );
    }

    #[test]
    fn confidence_without_a_message() {
        let reading = reading();
        assert!((reading.agreement() - 8.0 / 12.0).abs() < 1e-12);
        assert!((reading.mean_abs_logit() - 10.375 / 12.0).abs() < 1e-6);
    }

    #[test]
    fn what_cannot_be_read_is_refused() {
        assert!(PooledLogits::new(vec![]).is_err());
        assert!(PooledLogits::new(vec![vec![]]).is_err());
        assert!(PooledLogits::new(vec![vec![1.0], vec![1.0, 2.0]]).is_err());
        let error = PooledLogits::new(vec![vec![1.0], vec![f32::NAN]]).unwrap_err();
        assert!(error.to_string().contains("view 1 is NaN"), "{error}");
    }

    #[test]
    fn raw_messages_and_claims_judge_the_same_logits_alike() {
        let word = Message::from_u64(0x0123_4567_89ab_cdef);
        for (wrong, undecided) in [
            (0, 0),
            (9, 0),
            (26, 0),
            (27, 0),
            (8, 18),
            (8, 19),
            (0, 26),
            (0, 27),
            (0, 64),
        ] {
            let logit = |(place, bit): (usize, bool)| match place {
                place if place < undecided => [0.0, -0.0][place % 2],
                place if place < undecided + wrong => {
                    if bit {
                        -1.5
                    } else {
                        1.5
                    }
                }
                _ => {
                    if bit {
                        1.5
                    } else {
                        -1.5
                    }
                }
            };
            let logits: Vec<f32> = word.bits().enumerate().map(logit).collect();
            let raw = PooledLogits::new(vec![logits.clone()]).unwrap();
            let raw = raw.compare(&MessageCode::Plain, &word, &RULE).unwrap().decision;
            let claim = Claim {
                scheme: Scheme::default(),
                readings: &[HypothesisReading {
                    name: "as given".into(),
                    views: 1,
                    logits,
                    tries: 1,
                }],
                targets: &[Target {
                    id: "asset".into(),
                    word,
                    pad: None,
                }],
                targets_tried: None,
                other_tries: 1,
                rate: RULE.false_positive_rate,
            };
            let claimed = claim.test().unwrap().answer;
            let best = claimed.best.unwrap();
            assert_eq!(
                (raw.matched_bits, raw.rank_sum, raw.p_value, raw.needed_rank_sum),
                (best.matched_bits, best.rank_sum, best.p_value, claimed.needed_rank_sum),
                "{wrong} {undecided}"
            );
            assert_eq!(raw.matched_bits as usize, 64 - wrong - undecided);
            assert_eq!(raw.verdict, claimed.verdict);
        }
    }
}
