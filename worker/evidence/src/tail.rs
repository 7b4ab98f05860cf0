//! The exact tail of Binomial(n, 1/2): how likely it is that as many bits match by chance.

/// P(X ≥ `k`) for X ~ Binomial(`n`, 1/2), for n up to 150; 1 for k = 0, 0 for k > n.
///
/// Terms are C(n, i)/2ⁿ, built from i = n down by C(n, i−1) = C(n, i)·i/(n−i+1) and summed smallest first. All are
/// positive and none is below 2⁻¹⁵⁰, so the relative error stays under 3n units in the last place, 1e-13.
pub(crate) fn at_least(k: u32, n: u32) -> f64 {
    if k == 0 {
        return 1.0;
    }
    let mut term = 0.5_f64.powi(n as i32);
    let mut sum = 0.0;
    for i in (k..=n).rev() {
        sum += term;
        term *= f64::from(i) / f64::from(n - i + 1);
    }
    sum
}

/// `p` paid for by the number of hypotheses that were tried: the union bound, at most 1.
pub(crate) fn corrected(p: f64, hypotheses: u64) -> f64 {
    (p * hypotheses as f64).min(1.0)
}

/// The fewest of `n` matches whose corrected p-value is at or below `threshold`, `None` where even all `n` are not.
pub(crate) fn needed(n: u32, hypotheses: u64, threshold: f64) -> Option<u32> {
    (1..=n).find(|k| corrected(at_least(*k, n), hypotheses) <= threshold)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same in whole numbers: the sum of a row of Pascal's triangle, exact up to n = 127.
    fn exact(k: u32, n: u32) -> f64 {
        let mut row = vec![1_u128];
        for _ in 0..n {
            let mut next = vec![1; row.len() + 1];
            for i in 1..row.len() {
                next[i] = row[i - 1] + row[i];
            }
            row = next;
        }
        row[k as usize..].iter().sum::<u128>() as f64 / 2_f64.powi(n as i32)
    }

    #[test]
    fn agrees_with_whole_numbers() {
        for n in [1, 2, 7, 16, 32, 48, 64, 72, 100, 127] {
            for k in 0..=n {
                let (got, wanted) = (at_least(k, n), exact(k, n));
                assert!((got - wanted).abs() <= 1e-12 * wanted, "{k} of {n}: {got} {wanted}");
            }
        }
        assert_eq!(at_least(3, 2), 0.0);
    }

    #[test]
    fn the_longest_words_follow_from_shorter_ones() {
        for n in 128..=150 {
            for k in 1..=n {
                let wanted = (at_least(k - 1, n - 1) + at_least(k, n - 1)) / 2.0;
                let got = at_least(k, n);
                assert!((got - wanted).abs() <= 1e-12 * wanted, "{k} of {n}: {got} {wanted}");
            }
        }
        assert_eq!(at_least(150, 150), 2_f64.powi(-150));
    }

    #[test]
    fn an_unmarked_scene_of_32_bits_is_nothing_special() {
        // 65.41 % of 32 bits are 21 matches; P = 0.055 by R's pbinom(20, 32, 0.5, lower.tail = FALSE).
        assert!((at_least(21, 32) - 0.0550).abs() < 1e-4);
    }

    #[test]
    fn needed_matches_are_those_of_tables() {
        let rows = [
            (32, [Some(30), Some(32), None]),
            (48, [Some(41), Some(44), Some(47)]),
            (64, [Some(51), Some(56), Some(59)]),
            (72, [Some(57), Some(61), Some(65)]),
            (16, [None; 3]),
        ];
        for (n, wanted) in rows {
            assert_eq!([1e-6, 1e-9, 1e-12].map(|rate| needed(n, 1, rate)), wanted, "{n} bits");
        }
        // A thousand hypotheses cost a thousand: 1e-6 with them is 1e-9 without.
        assert_eq!(needed(64, 1000, 1e-6), needed(64, 1, 1e-9));
        assert_eq!(corrected(0.3, 10), 1.0);
    }
}
