//! Area under the ROC curve with the variance of DeLong, DeLong and Clarke-Pearson.
//!
//! "Comparing the areas under two or more correlated receiver operating characteristic curves: a nonparametric
//! approach", Biometrics 44 (1988); computed from midranks as Sun and Xu, "Fast implementation of DeLong's algorithm",
//! IEEE Signal Processing Letters 21 (2014).
use super::interval::{Interval, normal_width};
use super::proportion::clopper_pearson;
use super::summary::mean_and_deviation;
use crate::Result;

/// Area under the curve and its interval.
///
/// The area is the Mann-Whitney statistic: the probability that a positive scores higher than a negative, ties counted
/// half. With the placements `V10(i)`, the share of negatives below positive `i`, and `V01(j)`, the share of positives
/// above negative `j`, its variance is `var(V10) / m + var(V01) / n`.
///
/// The variance is 0 where one class scores above the other throughout, which no finite sample proves. There the
/// interval is the exact one of `min(m, n)` disjoint pairs, which are independent trials. One sample in a class has no
/// variance, so no interval.
pub(super) fn area(positives: &[f64], negatives: &[f64], confidence: f64) -> Result<(f64, Option<Interval>)> {
    let width = normal_width(confidence)?;
    let above = placements(positives, negatives);
    let below: Vec<f64> = placements(negatives, positives)
        .iter()
        .map(|share| 1.0 - share)
        .collect();
    let (area, spread) = mean_and_deviation(&above)?;
    let (_, other) = mean_and_deviation(&below)?;
    let (Some(spread), Some(other)) = (spread, other) else {
        return Ok((area, None));
    };
    if area == 0.0 || area == 1.0 {
        let pairs = positives.len().min(negatives.len()) as u64;
        let successes = if area == 0.0 { 0 } else { pairs };
        return Ok((area, Some(clopper_pearson(successes, pairs, confidence)?)));
    }
    let variance = spread * spread / positives.len() as f64 + other * other / negatives.len() as f64;
    let interval = Interval::around(area, width * variance.sqrt()).within(0.0, 1.0);
    Ok((area, Some(interval)))
}

/// For each value the share of `others` below it, ties counted half.
pub(super) fn placements(values: &[f64], others: &[f64]) -> Vec<f64> {
    let mut sorted = others.to_vec();
    sorted.sort_by(f64::total_cmp);
    let share = |value: &f64| {
        let below = sorted.partition_point(|other| other < value);
        let not_above = sorted.partition_point(|other| other <= value);
        // An exact count, so that complete separation gives exactly 1.
        (below + not_above) as f64 / (2 * sorted.len()) as f64
    };
    values.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The U-statistic's definition, pair by pair, and the variance of the area from its own kernel.
    fn brute_force(positives: &[f64], negatives: &[f64]) -> (f64, f64) {
        let kernel = |x: f64, y: f64| {
            if x > y {
                1.0
            } else if x == y {
                0.5
            } else {
                0.0
            }
        };
        let (m, n) = (positives.len(), negatives.len());
        let mut area = 0.0;
        for &x in positives {
            for &y in negatives {
                area += kernel(x, y) / (m * n) as f64;
            }
        }
        let mut variance = 0.0;
        for &x in positives {
            let v = negatives.iter().map(|&y| kernel(x, y)).sum::<f64>() / n as f64;
            variance += (v - area).powi(2) / ((m - 1) * m) as f64;
        }
        for &y in negatives {
            let v = positives.iter().map(|&x| kernel(x, y)).sum::<f64>() / m as f64;
            variance += (v - area).powi(2) / ((n - 1) * n) as f64;
        }
        (area, variance)
    }

    #[test]
    fn agrees_with_brute_force_with_ties() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for _ in 0..50 {
            let mut scores = |count: usize, up: i32| -> Vec<f64> {
                (0..count).map(|_| f64::from(rng.random_range(0..10) + up)).collect()
            };
            let (positives, negatives) = (scores(23, 2), scores(31, 0));
            let (area, interval) = super::area(&positives, &negatives, 0.95).unwrap();
            let (expected, variance) = brute_force(&positives, &negatives);
            assert!((area - expected).abs() < 1e-12);
            let high = (expected + 1.959_963_984_540_054 * variance.sqrt()).min(1.0);
            assert!((interval.unwrap().high - high).abs() < 1e-9);
        }
    }

    /// By hand: the positives 3 and 1 against the negatives 0, 1 and 2. V10 = 1, 1/2; V01 = 1, 3/4, 1/2.
    #[test]
    fn by_hand() {
        let (area, interval) = super::area(&[3.0, 1.0], &[0.0, 1.0, 2.0], 0.5).unwrap();
        assert!((area - 0.75).abs() < 1e-15);
        let variance = 0.125 / 2.0 + 0.0625 / 3.0;
        let low = 0.75 - 0.674_489_750_196_082 * f64::sqrt(variance);
        assert!((interval.unwrap().low - low).abs() < 1e-9);
    }

    /// For two normal distributions the area is known, and intervals must contain it about as often as they say.
    #[test]
    fn covers_as_often_as_it_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = |shift: f64| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0 + shift;
        let runs = 600;
        let covered = (0..runs)
            .filter(|_| {
                let positives: Vec<f64> = (0..60).map(|_| normal(1.0)).collect();
                let negatives: Vec<f64> = (0..60).map(|_| normal(0.0)).collect();
                let (_, interval) = area(&positives, &negatives, 0.95).unwrap();
                // Φ(1 / √2)
                interval.unwrap().contains(0.760_249_9)
            })
            .count();
        assert!((545..=595).contains(&covered), "{covered} of {runs}");
    }

    #[test]
    fn separation_is_not_certainty() {
        let (area, interval) = super::area(&[2.0; 10], &[1.0; 20], 0.95).unwrap();
        let interval = interval.unwrap();
        assert_eq!((area, interval.high), (1.0, 1.0));
        assert!((interval.low - 0.025_f64.powf(0.1)).abs() < 1e-9);
        let (area, interval) = super::area(&[0.0; 10], &[1.0; 20], 0.95).unwrap();
        assert_eq!((area, interval.unwrap().low), (0.0, 0.0));
        assert_eq!(super::area(&[1.0], &[0.0, 0.5], 0.95).unwrap(), (1.0, None));
    }
}
