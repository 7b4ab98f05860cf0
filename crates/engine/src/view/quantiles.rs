//! Weighted quantiles of many numbers, without sorting them: a scene's extent, kind and focus ask for some thirty.
//!
//! Numbers are told apart by their bits, eleven at a time from the highest in which they differ: each time the weights of all
//! that are alike in these are summed, and what is alike to the one that is sought is looked at further (a radix selection).

/// Bits that are looked at at a time.
const BITS: u32 = 11;

/// The smallest values below which, themselves included, lie at least those shares of the weight; zeros where there are none.
pub(super) fn quantiles<const N: usize>(
    values: impl Iterator<Item = f64>,
    weights: &[f64],
    shares: [f64; N],
) -> [f64; N] {
    let all: Vec<Weighed> = values.map(order).zip(weights.iter().copied()).collect();
    let total: f64 = weights.iter().sum();
    shares.map(|share| selected(&all, share * total))
}

/// A number by its [order], and its weight.
type Weighed = (u64, f64);

/// The smallest number at which the weights up to it reach `target`; the largest where rounding keeps them from it.
fn selected(all: &[Weighed], target: f64) -> f64 {
    let (mut below, mut sums) = (0.0, Vec::new());
    let mut alike: Vec<Weighed>;
    let mut among = all;
    loop {
        let orders = || among.iter().map(|(order, _)| *order);
        let Some((low, high)) = orders().min().zip(orders().max()) else {
            return 0.0;
        };
        if low == high {
            return number(low);
        }
        let shift = (high - low).ilog2().saturating_sub(BITS - 1);
        let place = |order: u64| ((order - low) >> shift) as usize;
        sums.clear();
        sums.resize(place(high) + 1, 0.0);
        for (order, weight) in among {
            sums[place(*order)] += weight;
        }
        let mut reached = place(high);
        for (place, sum) in sums[..reached].iter().enumerate() {
            if below + sum >= target {
                reached = place;
                break;
            }
            below += sum;
        }
        let of_it = among.iter().filter(|(order, _)| place(*order) == reached);
        alike = of_it.copied().collect();
        among = &alike;
    }
}

/// Whole numbers in the order of [`f64::total_cmp`].
fn order(value: f64) -> u64 {
    let bits = value.to_bits();
    match bits >> 63 {
        0 => bits | 1 << 63,
        _ => !bits,
    }
}

/// The number of that [order].
fn number(order: u64) -> f64 {
    f64::from_bits(match order >> 63 {
        0 => !order,
        _ => order & !(1 << 63),
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// By sorting.
    fn sorted<const N: usize>(values: &[f64], weights: &[f64], shares: [f64; N]) -> [f64; N] {
        let mut sorted: Vec<(f64, f64)> = values.iter().copied().zip(weights.iter().copied()).collect();
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = weights.iter().sum();
        shares.map(|share| {
            let mut below = 0.0;
            let found = sorted.iter().find(|(_, w)| {
                below += w;
                below >= share * total
            });
            found.or(sorted.last()).map_or(0.0, |(value, _)| *value)
        })
    }

    /// Weights are whole numbers, so that no order of summing rounds.
    #[test]
    fn they_are_those_of_sorted_numbers() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let shares = [0.0, 0.05, 0.1, 0.5, 0.75, 0.9, 0.95, 1.0];
        for count in [1, 2, 3, 10, 1000, 20_000] {
            for spread in [0.0, 1.0, 40.0, 300.0] {
                let values: Vec<f64> = (0..count)
                    .map(|_| random.random_range(-1.0..1.0) * 10_f64.powf(random.random_range(-1.0..=1.0) * spread))
                    .collect();
                for most in [1, 4, 1000] {
                    let weights: Vec<f64> = (0..count).map(|_| f64::from(random.random_range(0..=most))).collect();
                    let found = quantiles(values.iter().copied(), &weights, shares);
                    assert_eq!(found, sorted(&values, &weights, shares), "{count} {spread} {most}");
                }
            }
        }
    }

    #[test]
    fn odd_numbers_have_their_place() {
        fn of<const N: usize>(values: &[f64], shares: [f64; N]) -> [f64; N] {
            quantiles(values.iter().copied(), &vec![1.0; values.len()], shares)
        }
        assert_eq!(of(&[], [0.5]), [0.0]);
        assert_eq!(of(&[7.0; 5], [0.0, 0.5, 1.0]), [7.0; 3]);
        let infinite = [f64::INFINITY, -1.0, f64::NEG_INFINITY, 0.0, 1.0];
        assert_eq!(
            of(&infinite, [0.2, 0.4, 0.6, 1.0]),
            [f64::NEG_INFINITY, -1.0, 0.0, f64::INFINITY]
        );
        assert!(of(&[f64::NAN, 1.0, 2.0], [1.0])[0].is_nan());
        assert_eq!(of(&[f64::NAN, 1.0, 2.0], [0.5]), [2.0]);
        // Nothing has any weight, or one that is no number.
        assert_eq!(quantiles([3.0, 2.0].into_iter(), &[0.0, 0.0], [0.5]), [2.0]);
        assert_eq!(quantiles([3.0, 2.0].into_iter(), &[f64::NAN, 1.0], [0.5]), [3.0]);
        assert_eq!(
            [-2.5, -0.0, 0.0, 1e-310, 3.0].map(|value| number(order(value))),
            [-2.5, -0.0, 0.0, 1e-310, 3.0]
        );
    }
}
