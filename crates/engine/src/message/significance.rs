//! How sure a reading of a raw message is: the one decision that is taken on the exact tail of
//! [`guardsplat_codeword::chance`].
//!
//! Under the null hypothesis each of the n bits matches with probability 1/2, independently, because whoever chose the
//! message drew it at random and kept it secret; so p = P(Bin(n, 1/2) >= k). Pooled views are one word, not more trials.
use guardsplat_codeword::chance;
use serde::{Deserialize, Serialize};

/// p at or below which a reading is a match.
pub const FALSE_POSITIVE_RATE: f64 = 1e-6;

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

/// Decides at [`FALSE_POSITIVE_RATE`] whether `matched` of `bits` equal bits, the best of `hypotheses` tries, are a
/// match (union bound over the hypotheses).
pub fn decide(bits: u32, matched: u32, hypotheses: u32) -> Decision {
    let hypotheses = hypotheses.max(1);
    let threshold = FALSE_POSITIVE_RATE;
    // No message is longer than what the tail is computed for.
    let needed_bits = chance::least_matches(bits, threshold, hypotheses.into()).unwrap_or(None);
    let p = chance::tail(bits, matched).map_or(1.0, |p| chance::any_of(p, hypotheses.into()));
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
    match chance::reachable_rate(bits, hypotheses.into()) {
        Err(error) => error.to_string(),
        Ok(p) => format!(
            "{bits} bits tried {hypotheses} times can never reach p <= {threshold:e}: all of them match by chance \
             with p = {p:.1e}"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_messages_are_judged_too() {
        let best = decide(150, 150, 1);
        assert_eq!((best.verdict, best.p_value), (Verdict::Match, 2_f64.powi(-150)));
        assert_eq!(decide(150, 75, 1).verdict, Verdict::NoMatch);
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
        assert!((many.p_value - 10.0 * chance::tail(32, 30).unwrap()).abs() < 1e-18);
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
        let long = decide(200, 200, 1);
        assert_eq!((long.verdict, long.p_value), (Verdict::Inconclusive, 1.0));
        assert!(long.reason.unwrap().contains("outside 1 to 150"));
    }

    #[test]
    fn verdicts_are_snake_case_in_json() {
        let json = serde_json::to_value(decide(32, 16, 1)).unwrap();
        assert_eq!(json["verdict"], "no_match");
    }
}
