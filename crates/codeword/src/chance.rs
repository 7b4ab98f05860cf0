//! How likely it is that so many bits of a word match by chance: exact binomial tails. Claims are decided by how clearly
//! bits were read besides ([`signed_rank`](crate::signed_rank)); these tell what it would take if all were read alike.
//!
//! The embedded word is whitened by a secret uniform pad. So the matches of any fixed word of n bits with it are
//! Binomial(n, 1/2) for whoever lacks the pad, whatever the decoder's bias or the correlation between bits. Views of one
//! scene are one word: counting them as more bits is wrong by many orders of magnitude.
use crate::error::{Error, Result};
use crate::limits::MAX_BITS;

/// P(Bin(`n`, 1/2) >= `k`), with a relative error below 1e-13 down to the smallest value, 2^-150; 0 for `k` above `n`.
///
/// The sum of C(n, i) 2^-n from i = n downwards, each term from the one before: all terms are positive, so nothing
/// cancels, and all are exact as long as they are multiples of 2^-n below 2^(53 - n).
///
/// # Errors
/// [`Error::Length`] unless `n` is 1 to [`MAX_BITS`]. Larger numbers of trials come from views counted as bits.
pub fn tail(n: u32, k: u32) -> Result<f64> {
    check(n)?;
    Ok(match k {
        0 => 1.0, // the sum may be an ulp off
        _ => tails(n).take_while(|&(i, _)| i >= k).last().map_or(0.0, |(_, sum)| sum),
    })
}

/// The probability that at least one of `hypotheses` events of probability `p` happens, at most: the union bound, which
/// holds whatever their dependence. At most 1; no hypotheses count as one.
pub fn any_of(p: f64, hypotheses: u64) -> f64 {
    (p * hypotheses.max(1) as f64).min(1.0)
}

/// Fewest matches k of `n` bits for which [`any_of`] `hypotheses` tails is at most `rate`; `None` when not even n do.
///
/// # Errors
/// [`Error::Length`] as [`tail`], and [`Error::Rate`] unless the rate lies between 0 and 1.
pub fn least_matches(n: u32, rate: f64, hypotheses: u64) -> Result<Option<u32>> {
    check(n)?;
    check_rate(rate)?;
    let enough = tails(n).take_while(|&(_, sum)| any_of(sum, hypotheses) <= rate);
    Ok(enough.last().map(|(k, _)| k))
}

/// The smallest rate at which `n` bits can ever match, the best of `hypotheses`: that of all bits matching.
///
/// # Errors
/// [`Error::Length`] as [`tail`].
pub fn reachable_rate(n: u32, hypotheses: u64) -> Result<f64> {
    Ok(any_of(tail(n, n)?, hypotheses))
}

pub(crate) fn check_rate(rate: f64) -> Result<()> {
    if rate > 0.0 && rate < 1.0 {
        Ok(())
    } else {
        Err(Error::Rate { rate })
    }
}

pub(crate) fn check(n: u32) -> Result<()> {
    if (1..=MAX_BITS).contains(&n) {
        Ok(())
    } else {
        Err(Error::Length { bits: n as usize })
    }
}

/// Pairs of k and P(Bin(n, 1/2) >= k), for k from n down to 1.
fn tails(n: u32) -> impl Iterator<Item = (u32, f64)> {
    let mut term = 2_f64.powi(-(n as i32));
    let mut sum = 0.0;
    (1..=n).rev().map(move |i| {
        sum += term;
        term = term * f64::from(i) / f64::from(n - i + 1);
        (i, sum)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    /// A whole number below 2^192, lowest limb first.
    type Whole = [u64; 3];

    fn sum(a: &Whole, b: &Whole) -> Whole {
        let mut carry = 0;
        std::array::from_fn(|i| {
            let sum = u128::from(a[i]) + u128::from(b[i]) + carry;
            carry = sum >> 64;
            sum as u64
        })
    }

    /// Numerators of all tails over 2^n, for k = 0..=n, exactly: Pascal's triangle, summed from its end.
    fn exact(n: u32) -> Vec<Whole> {
        const ONE: Whole = [1, 0, 0];
        let mut row = vec![ONE];
        for _ in 0..n {
            let mut next = vec![ONE];
            next.extend(row.windows(2).map(|pair| sum(&pair[0], &pair[1])));
            next.push(ONE);
            row = next;
        }
        for i in (0..row.len() - 1).rev() {
            row[i] = sum(&row[i], &row[i + 1]);
        }
        row
    }

    /// Over 2^n, to a relative error of 2^-51: three roundings and two sums of positive numbers.
    fn fraction(whole: &Whole, n: u32) -> f64 {
        let limbs = whole.iter().zip([0, 64, 128]);
        limbs.map(|(limb, at)| *limb as f64 * 2_f64.powi(at - n as i32)).sum()
    }

    #[test]
    fn tails_agree_with_exact_arithmetic_for_all_lengths_and_matches() {
        // Row 4 is 1 4 6 4 1; carries reach the last limb at 2^150.
        let four: Vec<u64> = exact(4).iter().map(|whole| whole[0]).collect();
        assert_eq!(four, [16, 15, 11, 5, 1]);
        assert_eq!(exact(150)[0], [0, 0, 1 << 22]);
        for n in 1..=MAX_BITS {
            for (k, numerator) in exact(n).iter().enumerate() {
                let truth = fraction(numerator, n);
                let off = (tail(n, k as u32).unwrap() / truth - 1.0).abs();
                assert!(off < 1e-13, "{n} {k}: {off:e}");
            }
        }
        assert_eq!(tail(150, 150).unwrap(), 2_f64.powi(-150));
        assert!(tail(150, 150).unwrap() < 1e-45);
    }

    #[test]
    fn tails_have_their_known_values() {
        assert_eq!(tail(2, 1).unwrap(), 0.75);
        assert_eq!(tail(64, 0).unwrap(), 1.0);
        assert_eq!(tail(8, 9).unwrap(), 0.0);
        // An unmarked lego reads 65.41 % of 32 bits: 21 of them.
        assert!((tail(32, 21).unwrap() - 0.055).abs() < 5e-4);
        for n in [0, 151, 6400] {
            assert_eq!(tail(n, 1), Err(Error::Length { bits: n as usize }));
        }
    }

    #[test]
    fn least_matches_agree_with_the_published_table() {
        let table = [
            (32, [Some(30), Some(32), None]),
            (48, [Some(41), Some(44), Some(47)]),
            (64, [Some(51), Some(56), Some(59)]),
            (72, [Some(57), Some(61), Some(65)]),
            (16, [None, None, None]),
        ];
        for (n, expected) in table {
            for (rate, needed) in [1e-6, 1e-9, 1e-12].into_iter().zip(expected) {
                assert_eq!(least_matches(n, rate, 1).unwrap(), needed, "n = {n}, rate = {rate}");
                // Asking a thousand times as often asks as much as a rate a thousand times lower.
                assert_eq!(least_matches(n, rate * 1e3, 1000).unwrap(), needed);
            }
        }
    }

    #[test]
    fn least_matches_are_the_least_for_all_lengths() {
        for n in 1..=MAX_BITS {
            for (rate, hypotheses) in [
                (0.5, 1),
                (1e-3, 7),
                (1e-6, 1),
                (1e-6, 1_000_000),
                (1e-12, 1),
                (1e-40, 1),
            ] {
                let enough = |k| any_of(tail(n, k).unwrap(), hypotheses) <= rate;
                let naive = (0..=n).find(|&k| enough(k));
                assert_eq!(
                    least_matches(n, rate, hypotheses).unwrap(),
                    naive,
                    "{n} {rate} {hypotheses}"
                );
            }
        }
        for rate in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(least_matches(64, rate, 1), Err(Error::Rate { .. })));
        }
    }

    #[test]
    fn the_union_bound_is_capped() {
        assert_eq!(any_of(0.25, 0), 0.25);
        assert_eq!(any_of(0.25, 2), 0.5);
        assert_eq!(any_of(0.25, u64::MAX), 1.0);
        assert_eq!(reachable_rate(16, 1).unwrap(), 2_f64.powi(-16));
        assert_eq!(reachable_rate(16, 1 << 20).unwrap(), 1.0);
    }
}
