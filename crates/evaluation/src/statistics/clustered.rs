//! Area under the ROC curve of scores that come in clusters, such as views of the same scene.
//!
//! Obuchowski, "Nonparametric analysis of clustered ROC curve data", Biometrics 53 (1997): DeLong's placements, whose sums
//! over clusters are what varies independently. Clean and marked views of one scene are in one cluster, so that what
//! they have in common cancels.
use super::delong::placements;
use super::interval::{Interval, student_width};
use super::proportion::clopper_pearson;
use super::{bad, check_finite};
use crate::Result;

/// Scores of one cluster; either list may be empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cluster {
    /// Of positives, such as marked views; a higher score speaks for positive.
    pub positives: Vec<f64>,
    /// Of negatives.
    pub negatives: Vec<f64>,
}

/// The area over all scores, 0 to 1, ties counted half, and its interval at a confidence such as 0.95.
///
/// With `M` positives, `N` negatives and `I` clusters the variance is `I / (I - 1)` times the sum over clusters of
/// `(a / M + b / N)²`, where `a` and `b` are how far the sums of the placements of its positives and negatives are from
/// what they would be at the mean. As clusters are few, the interval has Student's quantile of `I - 1` degrees.
///
/// One cluster says nothing of others: there is no interval. Where the area is 0 or 1 the variance is 0, which no finite
/// sample proves; there the interval is the exact one of `I` trials.
///
/// # Errors
/// No positive, no negative, a score that is not finite, or a confidence outside (0, 1).
pub fn clustered_area(clusters: &[Cluster], confidence: f64) -> Result<(f64, Option<Interval>)> {
    let all = |of: fn(&Cluster) -> &[f64]| -> Vec<f64> { clusters.iter().flat_map(|c| of(c).to_vec()).collect() };
    let (positives, negatives) = (all(|c| &c.positives), all(|c| &c.negatives));
    for (field, scores) in [("positives", &positives), ("negatives", &negatives)] {
        check_finite(field, scores)?;
        if scores.is_empty() {
            return Err(bad(field, "there are none"));
        }
    }
    let (m, n) = (positives.len() as f64, negatives.len() as f64);
    let above = placements(&positives, &negatives);
    let below = placements(&negatives, &positives);
    let area = above.iter().sum::<f64>() / m;
    let width = student_width(confidence, clusters.len().saturating_sub(1).max(1))?;
    let used: Vec<&Cluster> = clusters
        .iter()
        .filter(|c| !c.positives.is_empty() || !c.negatives.is_empty())
        .collect();
    let count = used.len() as f64;
    if used.len() < 2 {
        return Ok((area, None));
    }
    if area == 0.0 || area == 1.0 {
        let trials = used.len() as u64;
        let successes = if area == 0.0 { 0 } else { trials };
        return Ok((area, Some(clopper_pearson(successes, trials, confidence)?)));
    }
    let (mut above, mut below) = (above.into_iter(), below.into_iter());
    let mut sum = 0.0;
    for cluster in used {
        let of_positives: f64 = above.by_ref().take(cluster.positives.len()).map(|v| v - area).sum();
        // The share of positives above a negative is what is left of those below it.
        let of_negatives: f64 = below
            .by_ref()
            .take(cluster.negatives.len())
            .map(|v| 1.0 - v - area)
            .sum();
        sum += (of_positives / m + of_negatives / n).powi(2);
    }
    let variance = count / (count - 1.0) * sum;
    let interval = Interval::around(area, width * variance.sqrt()).within(0.0, 1.0);
    Ok((area, Some(interval)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn cluster(positives: &[f64], negatives: &[f64]) -> Cluster {
        Cluster {
            positives: positives.to_vec(),
            negatives: negatives.to_vec(),
        }
    }

    /// By hand: positives 3 | 1, negatives 0 | 1, 2. V10 = 1 | 1/2 and V01 = 1 | 3/4, 1/2 around an area of 3/4, so that
    /// the clusters deviate by 1/4 / 2 + 1/4 / 3 = 5/24 and as much below.
    #[test]
    fn by_hand() {
        let clusters = [cluster(&[3.0], &[0.0]), cluster(&[1.0], &[1.0, 2.0])];
        let (area, interval) = clustered_area(&clusters, 0.5).unwrap();
        assert!((area - 0.75).abs() < 1e-15);
        // Student's quantile of one degree at 75 % is 1; 2 / 1 * 2 * (5/24)^2 is (10/24)^2, and 0.75 - 10/24 is 1/3.
        assert!((interval.unwrap().low - 1.0 / 3.0).abs() < 1e-9, "{interval:?}");
        assert_eq!(interval.unwrap().high, 1.0);
    }

    /// Clusters of one score each are independent: DeLong's interval, but for Student's quantile and `I / (I - 1)`.
    #[test]
    fn single_scores_are_those_of_delong() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let positives: Vec<f64> = (0..400).map(|_| rng.random::<f64>() + 0.3).collect();
        let negatives: Vec<f64> = (0..300).map(|_| rng.random::<f64>()).collect();
        let clusters: Vec<Cluster> = (positives.iter().map(|p| cluster(&[*p], &[])))
            .chain(negatives.iter().map(|n| cluster(&[], &[*n])))
            .collect();
        let (area, interval) = clustered_area(&clusters, 0.95).unwrap();
        let (expected, delong) = super::super::delong::area(&positives, &negatives, 0.95).unwrap();
        assert!((area - expected).abs() < 1e-12);
        assert!((interval.unwrap().low - delong.unwrap().low).abs() < 2e-4);
    }

    /// Copies of a score are one observation: they must not make the interval shorter, as they do DeLong's.
    #[test]
    fn copies_within_a_cluster_tell_nothing_new() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut clusters = |copies: usize| -> Vec<Cluster> {
            let mut one = |shift: f64| vec![rng.random::<f64>() + shift; copies];
            (0..12).map(|_| cluster(&one(0.2), &one(0.0))).collect()
        };
        let single = clusters(1);
        let copied: Vec<Cluster> = single
            .iter()
            .map(|c| cluster(&[c.positives[0]; 20], &[c.negatives[0]; 20]))
            .collect();
        let (a, b) = (
            clustered_area(&single, 0.95).unwrap(),
            clustered_area(&copied, 0.95).unwrap(),
        );
        assert!((a.0 - b.0).abs() < 1e-12);
        assert!((a.1.unwrap().low - b.1.unwrap().low).abs() < 1e-9);
    }

    /// Over clusters that share a shift, intervals must contain the area of all about as often as they say.
    #[test]
    fn covers_as_often_as_it_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let runs = 400;
        let covered = (0..runs)
            .filter(|_| {
                let clusters: Vec<Cluster> = (0..12)
                    .map(|_| {
                        let shift = normal();
                        let positives: Vec<f64> = (0..6).map(|_| normal() + shift + 1.0).collect();
                        let negatives: Vec<f64> = (0..6).map(|_| normal() + shift).collect();
                        cluster(&positives, &negatives)
                    })
                    .collect();
                // Differences of variance 4 around 1: Φ(1 / 2).
                clustered_area(&clusters, 0.95).unwrap().1.unwrap().contains(0.691_462)
            })
            .count();
        assert!((360..=396).contains(&covered), "{covered} of {runs}");
    }

    #[test]
    fn identical_pictures_separation_and_single_clusters() {
        let same = [cluster(&[1.0, 2.0], &[1.0, 2.0]), cluster(&[5.0], &[5.0])];
        let (area, interval) = clustered_area(&same, 0.95).unwrap();
        assert_eq!(area, 0.5);
        assert!(interval.unwrap().contains(0.5) && interval.unwrap().high - interval.unwrap().low < 1e-9);
        let apart = [cluster(&[2.0, 2.0], &[1.0]), cluster(&[3.0], &[0.0])];
        let (area, interval) = clustered_area(&apart, 0.95).unwrap();
        // Two trials: sqrt(0.025).
        assert_eq!((area, interval.unwrap().high), (1.0, 1.0));
        assert!((interval.unwrap().low - 0.025_f64.sqrt()).abs() < 1e-9);
        assert_eq!(clustered_area(&apart[..1], 0.95).unwrap(), (1.0, None));
        assert!(clustered_area(&[], 0.95).is_err());
        assert!(clustered_area(&[cluster(&[f64::NAN], &[1.0])], 0.95).is_err());
    }
}
