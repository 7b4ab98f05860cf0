//! How sure a reading is: exact binomial tails, and the one decision that is taken on them.
//!
//! Under the null hypothesis each of the n bits matches with probability 1/2, independently, because the embedded
//! word was whitened by a secret uniform pad; so p = P(Bin(n, 1/2) >= k). Pooled views are one word, not more trials.
use serde::{Deserialize, Serialize};

/// p at or below which a reading is a match.
pub const FALSE_POSITIVE_RATE: f64 = 1e-6;
/// Longest word for which the tail is computed.
pub const MAX_TRIALS: u32 = 128;

/// What a reading says about a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// p is at or below the threshold.
    Match,
    /// p is above the threshold.
    NoMatch,
    /// So few bits, or so many hypotheses, that even a perfect reading stays above the threshold.
    Inconclusive,
}

/// A verdict with what it rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// The outcome.
    pub verdict: Verdict,
    /// Probability of at least as many matching bits by chance, times the hypotheses tried, at most 1.
    pub p_value: f64,
    /// A match needs `p_value` at or below this.
    pub threshold: f64,
    /// Bits that match.
    pub matched_bits: u32,
    /// Bits compared.
    pub bits: u32,
    /// Matches that the verdict needs; `None` when no number would do.
    pub needed_bits: Option<u32>,
    /// Keys, crops and orientations that were tried to get here.
    pub hypotheses: u32,
    /// Why the reading cannot decide, when it cannot.
    pub reason: Option<String>,
}

/// Binomial coefficients C(n, 0..=n), exact: C(128, 64) < 2^125.
fn coefficients(n: u32) -> Vec<u128> {
    let mut row = vec![1_u128];
    for _ in 0..n {
        let mut next = vec![1];
        next.extend(row.windows(2).map(|pair| pair[0] + pair[1]));
        next.push(1);
        row = next;
    }
    row
}

/// P(Bin(n, 1/2) >= k), exact up to the last rounding to f64. `None` when n is above [`MAX_TRIALS`].
pub fn p_value(n: u32, k: u32) -> Option<f64> {
    if n > MAX_TRIALS {
        return None;
    }
    if k == 0 {
        return Some(1.0); // the one sum that would not fit: 2^128
    }
    let tail: u128 = coefficients(n).iter().skip(k as usize).sum();
    Some(tail as f64 / 2_f64.powi(n as i32))
}

/// Fewest matches k of n for which P(Bin(n, 1/2) >= k) <= `rate`; `None` when there is none or n is too large.
pub fn minimum_matches(n: u32, rate: f64) -> Option<u32> {
    (0..=n).find(|&k| p_value(n, k).is_some_and(|p| p <= rate))
}

/// Decides at [`FALSE_POSITIVE_RATE`] whether `matched` of `bits` equal bits, the best of `hypotheses` tries, are a
/// match (union bound over the hypotheses).
pub fn decide(bits: u32, matched: u32, hypotheses: u32) -> Decision {
    let hypotheses = hypotheses.max(1);
    let threshold = FALSE_POSITIVE_RATE;
    let needed_bits = minimum_matches(bits, threshold / f64::from(hypotheses));
    let p = p_value(bits, matched).map_or(1.0, |p| (p * f64::from(hypotheses)).min(1.0));
    let (verdict, reason) = match needed_bits {
        None => (Verdict::Inconclusive, Some(cannot_decide(bits, hypotheses, threshold))),
        Some(needed) if matched >= needed => (Verdict::Match, None),
        Some(_) => (Verdict::NoMatch, None),
    };
    Decision {
        verdict,
        p_value: p,
        threshold,
        matched_bits: matched,
        bits,
        needed_bits,
        hypotheses,
        reason,
    }
}

fn cannot_decide(bits: u32, hypotheses: u32, threshold: f64) -> String {
    match p_value(bits, bits) {
        None => format!("{bits} bits are more than the {MAX_TRIALS} that can be judged"),
        Some(p) => format!(
            "{bits} bits tried {hypotheses} times can never reach p <= {threshold:e}: all of them match by chance \
             with p = {:.1e}",
            (p * f64::from(hypotheses)).min(1.0)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minimum_matches_agree_with_the_published_table() {
        let table = [
            (32, [Some(30), Some(32), None]),
            (48, [Some(41), Some(44), Some(47)]),
            (64, [Some(51), Some(56), Some(59)]),
            (72, [Some(57), Some(61), Some(65)]),
            (16, [None, None, None]),
        ];
        for (n, expected) in table {
            for (rate, needed) in [1e-6, 1e-9, 1e-12].into_iter().zip(expected) {
                assert_eq!(minimum_matches(n, rate), needed, "n = {n}, rate = {rate}");
            }
        }
    }

    #[test]
    fn tails_are_exact() {
        assert_eq!(p_value(32, 32), Some(2_f64.powi(-32)));
        assert_eq!(p_value(2, 1), Some(0.75));
        assert_eq!(p_value(128, 128), Some(2_f64.powi(-128)));
        assert_eq!(p_value(0, 0), Some(1.0));
        assert_eq!(p_value(8, 9), Some(0.0));
        assert_eq!(p_value(129, 1), None);
        // An unmarked lego reads 65.41 % of 32 bits: 21 of them.
        assert!((p_value(32, 21).unwrap() - 0.055).abs() < 5e-4);
        for n in [1, 7, 64, 127, 128] {
            // P(X >= k) + P(X >= n - k + 1) = 1, by symmetry.
            let sum = p_value(n, n / 2 + 1).unwrap() + p_value(n, n - n / 2).unwrap();
            assert!((sum - 1.0).abs() < 1e-15, "{n}: {sum}");
        }
    }

    #[test]
    fn thirty_of_thirty_two_match_and_twenty_nine_do_not() {
        assert_eq!(decide(32, 30, 1).verdict, Verdict::Match);
        let miss = decide(32, 29, 1);
        assert_eq!(
            (miss.verdict, miss.needed_bits, miss.reason),
            (Verdict::NoMatch, Some(30), None)
        );
    }

    #[test]
    fn hypotheses_multiply_the_p_value() {
        let many = decide(32, 30, 10);
        assert_eq!((many.verdict, many.needed_bits), (Verdict::NoMatch, Some(31)));
        assert!((many.p_value - 10.0 * p_value(32, 30).unwrap()).abs() < 1e-18);
        assert_eq!(decide(32, 0, 10).p_value, 1.0);
        assert_eq!(decide(32, 32, u32::MAX).verdict, Verdict::Inconclusive);
    }

    #[test]
    fn sixteen_bits_are_inconclusive_and_say_why() {
        for matched in [8, 16] {
            let short = decide(16, matched, 1);
            assert_eq!(short.verdict, Verdict::Inconclusive);
            assert!(short.reason.unwrap().contains("can never reach p <= 1e-6"));
        }
        assert!(decide(200, 200, 1).reason.unwrap().contains("more than the 128"));
    }

    #[test]
    fn verdicts_are_snake_case_in_json() {
        let json = serde_json::to_value(decide(32, 16, 1)).unwrap();
        assert_eq!(json["verdict"], "no_match");
    }
}
