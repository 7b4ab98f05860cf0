//! The mean of what was measured in clusters, such as the bit accuracy of runs over scenes and seeds.
//!
//! Views of one marked scene read the same message with the same decoder, so they are far from independent: what is
//! repeated is the cluster (one scene with one seed), and an interval over its views alone would be too short.
use super::interval::{Interval, student_width, tail};
use super::summary::mean_and_deviation;
use super::{bad, check_finite};
use crate::Result;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// A mean over clusters that weigh the same, whatever their sizes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClusterMean {
    /// Number of clusters, at least 1.
    pub clusters: usize,
    /// Mean of their means.
    pub mean: f64,
    /// Confidence of the interval, such as 0.95.
    pub confidence: f64,
    /// Its interval; `None` of one cluster, which says nothing of the spread.
    pub interval: Option<Interval>,
}

/// Mean of every cluster, in their order.
///
/// # Errors
/// A cluster that is empty or has a value that is not finite.
pub fn cluster_means<C: AsRef<[f64]>>(clusters: &[C]) -> Result<Vec<f64>> {
    let mean = |cluster: &C| {
        check_finite("clusters", cluster.as_ref())?;
        Ok(mean_and_deviation(cluster.as_ref())?.0)
    };
    clusters.iter().map(mean).collect()
}

/// Student's interval of the mean over `n` clusters: `mean ± t(n-1) · s / √n`, with `s` the standard deviation of the
/// `means` of the clusters. It is not limited to the range of what is measured.
///
/// # Errors
/// No cluster, a mean that is not finite, or a confidence outside (0, 1).
pub fn student_mean(means: &[f64], confidence: f64) -> Result<ClusterMean> {
    check_finite("means", means)?;
    tail(confidence)?;
    let (mean, deviation) = mean_and_deviation(means)?;
    let interval = match deviation {
        None => None,
        Some(deviation) => {
            let half = student_width(confidence, means.len() - 1)? * deviation / (means.len() as f64).sqrt();
            Some(Interval::around(mean, half))
        }
    };
    Ok(ClusterMean {
        clusters: means.len(),
        mean,
        confidence,
        interval,
    })
}

/// Percentile bootstrap (Efron 1979) of the mean over clusters, which are drawn with replacement `resamples` times from
/// a stream that `seed` fixes. It stays within the range of the means, and is too short for few clusters, below about 15.
///
/// # Errors
/// No cluster, a mean that is not finite, a confidence outside (0, 1), or fewer resamples than 100.
pub fn bootstrap_mean(means: &[f64], confidence: f64, resamples: usize, seed: u64) -> Result<ClusterMean> {
    check_finite("means", means)?;
    let tail = tail(confidence)?;
    let (mean, _) = mean_and_deviation(means)?;
    if resamples < 100 {
        return Err(bad("resamples", format!("{resamples} are fewer than 100")));
    }
    let interval = (means.len() > 1).then(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut drawn: Vec<f64> = (0..resamples)
            .map(|_| {
                let sum: f64 = (0..means.len()).map(|_| means[rng.random_range(0..means.len())]).sum();
                sum / means.len() as f64
            })
            .collect();
        drawn.sort_by(f64::total_cmp);
        Interval {
            low: quantile(&drawn, tail),
            high: quantile(&drawn, 1.0 - tail),
        }
    });
    Ok(ClusterMean {
        clusters: means.len(),
        mean,
        confidence,
        interval,
    })
}

/// Quantile of sorted values, at least one, between neighbours in proportion (Hyndman and Fan's type 7).
fn quantile(sorted: &[f64], probability: f64) -> f64 {
    let last = sorted.len() - 1;
    let position = probability * last as f64;
    let below = (position.floor() as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Student's sleep data (1908): differences of ten patients; R's `t.test` gives 0.7001142 to 2.4598858.
    #[test]
    fn student_is_that_of_r() {
        let differences = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
        let mean = student_mean(&differences, 0.95).unwrap();
        let interval = mean.interval.unwrap();
        assert!((mean.mean - 1.58).abs() < 1e-12);
        assert!((interval.low - 0.700_114_2).abs() < 1e-6 && (interval.high - 2.459_885_8).abs() < 1e-6);
    }

    #[test]
    fn clusters_weigh_the_same() {
        let means = cluster_means(&[vec![1.0; 100], vec![0.0, 0.5]]).unwrap();
        assert_eq!(means, [1.0, 0.25]);
        assert_eq!(student_mean(&means, 0.9).unwrap().mean, 0.625);
        assert!(cluster_means(&[vec![1.0], vec![]]).is_err());
        assert!(cluster_means(&[vec![f64::NAN]]).is_err());
    }

    #[test]
    fn bootstrap_is_seeded_and_near_the_normal_interval() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let means: Vec<f64> = (0..200).map(|_| rng.random::<f64>()).collect();
        let first = bootstrap_mean(&means, 0.95, 2000, 7).unwrap();
        assert_eq!(first, bootstrap_mean(&means, 0.95, 2000, 7).unwrap());
        assert_ne!(first, bootstrap_mean(&means, 0.95, 2000, 8).unwrap());
        let student = student_mean(&means, 0.95).unwrap().interval.unwrap();
        let bootstrap = first.interval.unwrap();
        let width = student.high - student.low;
        assert!(
            (student.low - bootstrap.low).abs() < 0.15 * width,
            "{student:?} {bootstrap:?}"
        );
        assert!((student.high - bootstrap.high).abs() < 0.15 * width);
    }

    /// Repeated on fresh samples, intervals must contain the true mean about as often as they say.
    #[test]
    fn student_covers_as_often_as_it_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let runs = 2000;
        let covered = (0..runs)
            .filter(|_| {
                let means: Vec<f64> = (0..5).map(|_| (0..12).map(|_| rng.random::<f64>()).sum()).collect();
                student_mean(&means, 0.9).unwrap().interval.unwrap().contains(6.0)
            })
            .count();
        // Standard deviation of the count is 13.
        assert!((covered as f64 - 0.9 * runs as f64).abs() < 55.0, "{covered}");
    }

    #[test]
    fn none_and_one() {
        assert!(student_mean(&[], 0.95).is_err() && bootstrap_mean(&[], 0.95, 1000, 1).is_err());
        for one in [student_mean(&[0.5], 0.95), bootstrap_mean(&[0.5], 0.95, 1000, 1)] {
            let one = one.unwrap();
            assert_eq!((one.clusters, one.mean, one.interval), (1, 0.5, None));
        }
        assert!(student_mean(&[0.5, f64::NAN], 0.95).is_err());
        assert!(student_mean(&[0.5], 1.5).is_err());
        assert!(bootstrap_mean(&[0.5, 1.0], 0.95, 10, 1).is_err());
    }
}
