//! How likely it is that a word matches as clearly by chance: Wilcoxon's signed-rank test, exactly.
//!
//! The bits of a reading are ranked by the size of their logits, 1 for the least clear and n for the clearest. The *rank
//! sum* of a word is that of the bits that match it. Whatever the logits are, a word under a secret uniform pad matches
//! each bit as a thrown coin would, so its rank sum is distributed as that of a random subset of 1 to n (F. Wilcoxon,
//! "Individual comparisons by ranking methods", Biometrics Bulletin 1, 1945). Bits that are read wrong are mostly bits that
//! were hardly read; so marks reach a given rate with fewer matches than if all bits counted alike.
use std::sync::OnceLock;

use crate::chance::{any_of, check, check_rate};
use crate::error::Result;
use crate::limits::MAX_BITS;

/// Ranks of the bits of a message, as many as it has bits; zeros beyond.
pub(crate) type Ranks = [u8; MAX_BITS as usize];

/// Ranks by the size of the logits, 1 for the least. Of equal ones the earlier bit has the lower rank; NaN counts as 0.
pub(crate) fn ranks(logits: &[f32]) -> Ranks {
    // Sizes that are not negative are in the order of their bits; the position behind them orders equal ones.
    let key = |(position, logit): (u8, &f32)| {
        let size = if logit.is_nan() { 0 } else { logit.abs().to_bits() };
        u64::from(size) << 8 | u64::from(position)
    };
    let mut order: Vec<u64> = (0..MAX_BITS as u8).zip(logits).map(key).collect();
    order.sort_unstable();
    let mut ranks = [0; MAX_BITS as usize];
    for (key, rank) in order.into_iter().zip(1..) {
        ranks[(key & 0xff) as usize] = rank;
    }
    ranks
}

/// The largest rank sum of `n` bits, that of all of them: n (n + 1) / 2.
pub fn largest(n: u32) -> u32 {
    n * (n + 1) / 2
}

/// P(rank sum of `n` bits >= `rank_sum`) by chance, with a relative error below 1e-12; 0 above [`largest`].
///
/// # Errors
/// [`Error::Length`](crate::Error::Length) unless `n` is 1 to [`MAX_BITS`].
pub fn tail(n: u32, rank_sum: u32) -> Result<f64> {
    Ok(tails(n)?.get(rank_sum as usize).copied().unwrap_or(0.0))
}

/// The least rank sum of `n` bits for which [`any_of`] `hypotheses` tails is at most `rate`; `None` when not even that of
/// all bits is.
///
/// # Errors
/// As [`tail`], and [`Error::Rate`](crate::Error::Rate) unless the rate lies between 0 and 1.
pub fn least(n: u32, rate: f64, hypotheses: u64) -> Result<Option<u32>> {
    check_rate(rate)?;
    let tails = tails(n)?;
    let least = tails.partition_point(|tail| any_of(*tail, hypotheses) > rate);
    Ok((least < tails.len()).then_some(least as u32))
}

/// P(rank sum >= s) of `n` bits for s from 0 to [`largest`]; computed once a length.
fn tails(n: u32) -> Result<&'static [f64]> {
    static TABLES: [OnceLock<Vec<f64>>; MAX_BITS as usize + 1] = [const { OnceLock::new() }; MAX_BITS as usize + 1];
    check(n)?;
    Ok(TABLES[n as usize].get_or_init(|| table(n)))
}

/// Probabilities by adding one rank at a time, each in half of the cases; all terms are positive, so nothing cancels.
fn table(n: u32) -> Vec<f64> {
    let mut sums = vec![0.0_f64; largest(n) as usize + 1];
    sums[0] = 1.0;
    for rank in 1..=n as usize {
        for sum in (0..=largest(rank as u32) as usize).rev() {
            let without = sums[sum];
            let with = if sum >= rank { sums[sum - rank] } else { 0.0 };
            sums[sum] = (without + with) / 2.0;
        }
    }
    let mut above = 0.0;
    for probability in sums.iter_mut().rev() {
        above += *probability;
        *probability = above;
    }
    sums[0] = 1.0; // the sum may be some ulps off
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance;
    use crate::error::Error;
    use proptest::prelude::*;

    /// Subsets of 1 to n with each sum, exactly; fits up to 127.
    fn subsets(n: u32) -> Vec<u128> {
        let mut counts = vec![0_u128; largest(n) as usize + 1];
        counts[0] = 1;
        for rank in 1..=n as usize {
            for sum in (rank..counts.len()).rev() {
                counts[sum] += counts[sum - rank];
            }
        }
        counts
    }

    #[test]
    fn tails_agree_with_exact_counts() {
        for n in [1, 2, 3, 10, 16, 32, 64, 100, 127] {
            let mut above = 0_u128;
            for (sum, count) in subsets(n).into_iter().enumerate().rev() {
                above += count;
                let truth = above as f64 * 2_f64.powi(-(n as i32));
                let off = (tail(n, sum as u32).unwrap() / truth - 1.0).abs();
                assert!(off < 1e-12, "{n} {sum}: {off:e}");
            }
        }
    }

    #[test]
    fn the_longest_are_symmetric_and_reach_their_smallest_value() {
        for n in [128, 150] {
            assert_eq!(tail(n, largest(n)).unwrap(), 2_f64.powi(-(n as i32)));
            for sum in (1..=largest(n)).step_by(97) {
                let below = tail(n, largest(n) + 1 - sum).unwrap();
                assert!((tail(n, sum).unwrap() + below - 1.0).abs() < 1e-12, "{n} {sum}");
            }
        }
    }

    #[test]
    fn tails_have_the_values_of_published_tables() {
        // P(W <= 8) of 10 pairs is 0.0244, and P(W <= 60) of 20 is 0.0487 (Wilcoxon and Wilcox 1964, one-sided).
        assert!((tail(10, largest(10) - 8).unwrap() - 0.0244).abs() < 5e-5);
        assert!((tail(20, largest(20) - 60).unwrap() - 0.0487).abs() < 5e-5);
        assert_eq!(tail(1, 1).unwrap(), 0.5);
        assert_eq!((tail(64, 0).unwrap(), tail(64, 2081).unwrap()), (1.0, 0.0));
        for n in [0, 151] {
            assert_eq!(tail(n, 1), Err(Error::Length { bits: n as usize }));
        }
    }

    #[test]
    fn the_least_is_the_least() {
        for n in [1, 16, 20, 21, 32, 64, 150] {
            for (rate, hypotheses) in [(0.5, 1), (1e-3, 7), (1e-6, 1), (1e-6, 1_000_000), (1e-40, 1)] {
                let enough = |sum| any_of(tail(n, sum).unwrap(), hypotheses) <= rate;
                let naive = (0..=largest(n)).find(|sum| enough(*sum));
                assert_eq!(least(n, rate, hypotheses).unwrap(), naive, "{n} {rate} {hypotheses}");
            }
        }
        // All bits match as seldom as they do when they are counted.
        assert_eq!(tail(20, largest(20)).unwrap(), chance::tail(20, 20).unwrap());
        assert_eq!(least(16, 1e-6, 1).unwrap(), None);
        assert!(matches!(least(64, 0.0, 1), Err(Error::Rate { .. })));
    }

    #[test]
    fn the_clearest_bit_has_the_highest_rank() {
        let found = ranks(&[0.5, -3.0, f32::NAN, 0.0, f32::NEG_INFINITY, -0.5]);
        assert_eq!(found[..7], [3, 5, 1, 2, 6, 4, 0]);
    }

    proptest! {
        #[test]
        fn ranks_are_those_of_an_ordering(logits in prop::collection::vec(prop::num::f32::ANY, 1..=150)) {
            let found = ranks(&logits);
            let mut sorted = found[..logits.len()].to_vec();
            sorted.sort_unstable();
            prop_assert!(sorted.into_iter().eq(1..=logits.len() as u8));
            for (a, x) in logits.iter().enumerate() {
                for (b, y) in logits.iter().enumerate() {
                    prop_assert!(!(x.abs() < y.abs() && found[a] > found[b]));
                }
            }
        }
    }
}
