//! How well scores tell positives from negatives, at every threshold.
use super::interval::Interval;
use super::{bad, check_finite, delong};
use crate::Result;
use serde::{Deserialize, Serialize};

/// Rates at one threshold: what scores at least as high is called positive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RocPoint {
    /// The score, or `None` for the first point, at which nothing is called positive.
    pub threshold: Option<f64>,
    /// Share of negatives that are called positive, 0 to 1.
    pub false_positive_rate: f64,
    /// Share of positives that are called positive, 0 to 1.
    pub true_positive_rate: f64,
}

/// The threshold with the largest mean of true-positive rate and true-negative rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BalancedAccuracy {
    /// That mean, 0.5 to 1.
    pub accuracy: f64,
    /// As in [`RocPoint::threshold`]; the highest one of equals.
    pub threshold: Option<f64>,
}

/// The curve of receiver operating characteristics and what follows from it.
///
/// Intervals take every score for independent, which views of one scene are not: give one score a scene, or take the
/// intervals for too short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Roc {
    /// Number of positives, at least 1.
    pub positives: usize,
    /// Number of negatives, at least 1.
    pub negatives: usize,
    /// From (0, 0) to (1, 1), one point for every score that occurs, ties in one step; both rates never fall.
    pub points: Vec<RocPoint>,
    /// Area under the curve, 0 to 1: the probability that a positive scores higher than a negative, ties counted half.
    pub area: f64,
    /// Confidence of the interval, such as 0.95.
    pub confidence: f64,
    /// Interval of the area (DeLong et al. 1988; the exact one of `min(positives, negatives)` pairs where the area is 0
    /// or 1); `None` if there is but one positive or one negative.
    pub area_interval: Option<Interval>,
    /// The best threshold. Chosen on the scores it is measured on, so it flatters.
    pub best: BalancedAccuracy,
}

impl Roc {
    /// From scores of which higher ones speak for positive.
    ///
    /// # Errors
    /// No positive, no negative, a score that is not finite, or a confidence outside (0, 1).
    pub fn new(positives: &[f64], negatives: &[f64], confidence: f64) -> Result<Self> {
        for (field, scores) in [("positives", positives), ("negatives", negatives)] {
            check_finite(field, scores)?;
            if scores.is_empty() {
                return Err(bad(field, "there are none"));
            }
        }
        let (area, area_interval) = delong::area(positives, negatives, confidence)?;
        let points = curve(positives, negatives);
        let best = best(&points);
        Ok(Self {
            positives: positives.len(),
            negatives: negatives.len(),
            points,
            area,
            confidence,
            area_interval,
            best,
        })
    }

    /// Largest true-positive rate with a false-positive rate of at most `false_positive_rate`.
    ///
    /// A threshold that exists, nothing between two: with fewer negatives than one in the rate, none may be called
    /// positive. NaN and what is below 0 give 0.
    pub fn true_positive_rate_at(&self, false_positive_rate: f64) -> f64 {
        let allowed = |point: &&RocPoint| point.false_positive_rate <= false_positive_rate;
        let rates = self.points.iter().filter(allowed).map(|point| point.true_positive_rate);
        rates.fold(0.0, f64::max)
    }
}

fn curve(positives: &[f64], negatives: &[f64]) -> Vec<RocPoint> {
    let mut scores: Vec<(f64, bool)> = Vec::with_capacity(positives.len() + negatives.len());
    // Adding zero makes one zero of both, which is one score.
    scores.extend(positives.iter().map(|score| (score + 0.0, true)));
    scores.extend(negatives.iter().map(|score| (score + 0.0, false)));
    scores.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut points = vec![RocPoint {
        threshold: None,
        false_positive_rate: 0.0,
        true_positive_rate: 0.0,
    }];
    let (mut hits, mut alarms) = (0_usize, 0_usize);
    for ties in scores.chunk_by(|a, b| a.0 == b.0) {
        let count = ties.iter().filter(|(_, positive)| *positive).count();
        hits += count;
        alarms += ties.len() - count;
        points.push(RocPoint {
            threshold: ties.first().map(|(score, _)| *score),
            false_positive_rate: alarms as f64 / negatives.len() as f64,
            true_positive_rate: hits as f64 / positives.len() as f64,
        });
    }
    points
}

fn best(points: &[RocPoint]) -> BalancedAccuracy {
    let mut best = BalancedAccuracy {
        accuracy: 0.5,
        threshold: None,
    };
    for point in points {
        let accuracy = f64::midpoint(point.true_positive_rate, 1.0 - point.false_positive_rate);
        if accuracy > best.accuracy {
            best = BalancedAccuracy {
                accuracy,
                threshold: point.threshold,
            };
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn by_hand() {
        let roc = Roc::new(&[0.9, 0.8, 0.4], &[0.4, 0.3, 0.8, 0.1], 0.95).unwrap();
        let rates: Vec<_> = roc
            .points
            .iter()
            .map(|point| {
                (
                    point.threshold,
                    point.false_positive_rate * 4.0,
                    point.true_positive_rate * 3.0,
                )
            })
            .collect();
        let expected = [
            (None, 0.0, 0.0),
            (Some(0.9), 0.0, 1.0),
            (Some(0.8), 1.0, 2.0),
            (Some(0.4), 2.0, 3.0),
            (Some(0.3), 3.0, 3.0),
            (Some(0.1), 4.0, 3.0),
        ];
        assert_eq!(rates, expected);
        // 4 + 3.5 + 2.5 pairs of 12.
        assert!((roc.area - 10.0 / 12.0).abs() < 1e-15);
        assert_eq!((roc.best.accuracy, roc.best.threshold), (0.75, Some(0.4)));
        assert_eq!(roc.true_positive_rate_at(0.0), 1.0 / 3.0);
        assert_eq!(roc.true_positive_rate_at(0.25), 2.0 / 3.0);
        assert_eq!(roc.true_positive_rate_at(0.49), 2.0 / 3.0);
        assert_eq!(roc.true_positive_rate_at(1.0), 1.0);
        assert_eq!(roc.true_positive_rate_at(f64::NAN), 0.0);
    }

    /// The Mann-Whitney statistic is the area under the trapezoids of the curve.
    #[test]
    fn area_is_that_of_the_trapezoids() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        for _ in 0..50 {
            let mut scores = |count| -> Vec<f64> { (0..count).map(|_| f64::from(rng.random_range(-4..9))).collect() };
            let (positives, negatives) = (scores(17), scores(29));
            let roc = Roc::new(&positives, &negatives, 0.95).unwrap();
            let trapezoids: f64 = roc
                .points
                .windows(2)
                .map(|pair| {
                    (pair[1].false_positive_rate - pair[0].false_positive_rate)
                        * f64::midpoint(pair[0].true_positive_rate, pair[1].true_positive_rate)
                })
                .sum();
            assert!((roc.area - trapezoids).abs() < 1e-12);
            let swapped = Roc::new(&negatives, &positives, 0.95).unwrap();
            assert!((roc.area + swapped.area - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn order_of_scores_does_not_matter() {
        let forth = Roc::new(&[0.0, 0.5, -0.0], &[0.25, 0.0], 0.95).unwrap();
        assert_eq!(forth, Roc::new(&[-0.0, 0.0, 0.5], &[0.0, 0.25], 0.95).unwrap());
        assert_eq!(forth.points.len(), 4);
    }

    #[test]
    fn equal_scores_tell_nothing() {
        let roc = Roc::new(&[1.0; 5], &[1.0; 3], 0.95).unwrap();
        assert_eq!((roc.area, roc.best.accuracy, roc.best.threshold), (0.5, 0.5, None));
        assert_eq!((roc.points.len(), roc.true_positive_rate_at(0.5)), (2, 0.0));
    }

    #[test]
    fn none_not_finite_and_json() {
        assert!(Roc::new(&[], &[1.0], 0.95).is_err());
        assert!(Roc::new(&[1.0], &[], 0.95).is_err());
        assert!(Roc::new(&[f64::NAN], &[1.0], 0.95).is_err());
        assert!(Roc::new(&[1.0], &[f64::INFINITY], 0.95).is_err());
        assert!(Roc::new(&[1.0], &[0.0], 0.0).is_err());
        let roc = Roc::new(&[1.0, 0.5], &[0.0, 0.75], 0.95).unwrap();
        let text = serde_json::to_string(&roc).unwrap();
        assert_eq!(serde_json::from_str::<Roc>(&text).unwrap(), roc);
    }
}
