//! How the tower's averages vary by themselves: from view to view, by what people do to pictures, and from scene to scene.
//!
//! Averages are brought to length 1 first, since what is read of them later is their direction.
use std::ops::Range;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::everyday::{self, SIDE};
use super::scenes::{Detail, ViewedScene};
use super::{IMAGE_SIZE, TrainOptions, TrainProgress, host};
use crate::clip::{ClipConfig, RandomFourierEncoder, preprocess};
use crate::device::Compute;
use crate::error::Result;
use crate::extract::rasterizer;
use crate::picture::Picture;
use crate::quality::batch;

/// Grounds that scenes are seen over, one a view. Readers make a grey one white.
const GROUNDS: [f32; 6] = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
/// Share of the covariance of which only the diagonal is taken (Ledoit and Wolf 2004): some hundred scenes do not tell how
/// as many averages go together, and the head would find combinations that vanish in these scenes only.
const SHRUNK: f64 = 0.2;
/// The same of the squared means of scenes, of which there are fewer.
const SHRUNK_MEANS: f64 = 0.5;
/// Averages of this length are nothing.
const NOTHING: f64 = 1e-3;
/// Draws of what is done to pictures are none of a scene's own.
const STREAM: u64 = 81;

/// What was measured, for `n` averages.
pub(super) struct Variation {
    /// Covariance within a scene, over views and what was done to their pictures, plus the squared means of scenes,
    /// `[n][n]`.
    pub covariance: Vec<f64>,
    /// Share of each average that is left after what was done to pictures, `[n]`: the slope of the distorted over the
    /// clean. What a mark adds is left to the same share.
    pub left: Vec<f64>,
}

impl Variation {
    /// Measures the scenes with these indices.
    pub fn measure(
        tower: &RandomFourierEncoder,
        config: &ClipConfig,
        options: &TrainOptions,
        scenes: Range<u64>,
        compute: &Compute,
        progress: &mut impl FnMut(TrainProgress),
    ) -> Result<Self> {
        let count = (scenes.end - scenes.start) as usize;
        let mut sums = Sums::default();
        for (done, index) in scenes.enumerate() {
            for (weight, rows) in averages(tower, config, options, index, compute)? {
                sums.hear(weight, rows);
            }
            sums.end_scene();
            progress(TrainProgress::Natural(done + 1, count));
        }
        Ok(sums.variation())
    }
}

/// Weights, and averages `[views][n]` of length 1, of a scene's pictures as they are and as each distortion leaves them.
fn averages(
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    options: &TrainOptions,
    index: u64,
    compute: &Compute,
) -> Result<Vec<(f64, Vec<Vec<f64>>)>> {
    let rasterizer = rasterizer(compute)?;
    let scene = ViewedScene::new(options, index, GROUNDS.len(), Detail::large(SIDE))?;
    let pictures: Vec<Picture> = scene
        .views
        .iter()
        .zip(&GROUNDS)
        .map(|(view, &ground)| scene.picture(rasterizer.as_ref(), view, ground))
        .collect::<Result<_>>()?;
    let pictures = batch(&pictures.iter().collect::<Vec<_>>(), &compute.device)?;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed.wrapping_mul(1 << 20).wrapping_add(index));
    rng.set_stream(STREAM);
    everyday::all(options.compression)
        .into_iter()
        .map(|(what, weight)| {
            let done = what.apply(&pictures, &mut rng)?;
            let input = preprocess(done, IMAGE_SIZE, &config.normalization);
            let values = host(tower.statistics(&input), compute)?;
            let rows = values.chunks_exact(values.len() / GROUNDS.len()).map(unit);
            Ok((weight, rows.collect()))
        })
        .collect()
}

/// A row at length 1.
fn unit(row: &[f32]) -> Vec<f64> {
    let length = row.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt() + NOTHING;
    row.iter().map(|v| f64::from(*v) / length).collect()
}

/// Sums over scenes.
#[derive(Default)]
struct Sums {
    scenes: f64,
    /// Of the scene that is heard of: weights and rows, the clean ones first.
    heard: Vec<(f64, Vec<Vec<f64>>)>,
    within: Vec<f64>,
    means: Vec<f64>,
    /// Products of distorted and clean averages, and squares of the clean ones.
    slopes: Vec<[f64; 2]>,
}

impl Sums {
    fn hear(&mut self, weight: f64, rows: Vec<Vec<f64>>) {
        self.heard.push((weight, rows));
    }

    fn end_scene(&mut self) {
        let heard = std::mem::take(&mut self.heard);
        let Some(n) = heard.first().and_then(|(_, rows)| rows.first()).map(Vec::len) else {
            return;
        };
        self.within.resize(n * n, 0.0);
        self.means.resize(n * n, 0.0);
        self.slopes.resize(n, [0.0; 2]);
        let weights: f64 = heard.iter().map(|(weight, _)| weight).sum();
        let all = || {
            heard
                .iter()
                .flat_map(|(weight, rows)| rows.iter().map(move |row| (weight, row)))
        };
        let mut mean = vec![0.0; n];
        for (weight, row) in all() {
            let share = weight / weights / GROUNDS.len() as f64;
            mean.iter_mut().zip(row).for_each(|(m, v)| *m += share * v);
        }
        for (weight, row) in all() {
            let centred: Vec<f64> = row.iter().zip(&mean).map(|(v, m)| v - m).collect();
            add_square(&mut self.within, &centred, weight / weights / GROUNDS.len() as f64);
        }
        add_square(&mut self.means, &mean, 1.0);
        let clean = &heard[0].1;
        for (weight, rows) in &heard {
            for (row, clean) in rows.iter().zip(clean) {
                for (slope, (v, c)) in self.slopes.iter_mut().zip(row.iter().zip(clean)) {
                    slope[0] += weight * v * c;
                    slope[1] += weight * c * c;
                }
            }
        }
        self.scenes += 1.0;
    }

    fn variation(self) -> Variation {
        let n = self.slopes.len();
        let shrunk = |sum: f64, i: usize, share: f64| match i / n == i % n {
            true => sum,
            false => (1.0 - share) * sum,
        };
        let sums = self.within.iter().zip(&self.means).enumerate();
        let covariance = sums.map(|(i, (within, means))| {
            (shrunk(*within, i, SHRUNK) + shrunk(*means, i, SHRUNK_MEANS)) / self.scenes.max(1.0)
        });
        Variation {
            covariance: covariance.collect(),
            left: self
                .slopes
                .iter()
                .map(|[a, b]| (a / b.max(f64::MIN_POSITIVE)).clamp(0.0, 1.2))
                .collect(),
        }
    }
}

/// Adds `weight v vt`.
fn add_square(sum: &mut [f64], v: &[f64], weight: f64) {
    for (row, x) in sum.chunks_exact_mut(v.len()).zip(v) {
        row.iter_mut().zip(v).for_each(|(sum, y)| *sum += weight * x * y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariances_and_slopes_of_rows_that_are_known() {
        let mut sums = Sums::default();
        let clean = vec![vec![1.0, 0.0]; GROUNDS.len()];
        // What is done halves the first average, and adds to the second.
        let distorted = vec![vec![0.5, 0.2]; GROUNDS.len()];
        sums.hear(1.0, clean);
        sums.hear(1.0, distorted);
        sums.end_scene();
        let found = sums.variation();
        // Within: deviations of +-(0.25, -0.1); means: (0.75, 0.1).
        let expected = [
            0.0625 + 0.5625,
            -0.025 * (1.0 - SHRUNK) + 0.075 * (1.0 - SHRUNK_MEANS),
            0.01 + 0.01,
        ];
        for (i, expected) in [0, 1, 3].into_iter().zip(expected) {
            assert!((found.covariance[i] - expected).abs() < 1e-12, "{i}");
        }
        assert_eq!(found.covariance[1], found.covariance[2]);
        assert!((found.left[0] - 0.75).abs() < 1e-12);
    }

    #[test]
    fn rows_have_length_one_and_nothing_stays_nothing() {
        let row = unit(&[3.0, 4.0]);
        assert!((row[0] - 0.6).abs() < 1e-3 && (row[1] - 0.8).abs() < 1e-3);
        assert_eq!(unit(&[0.0, 0.0]), [0.0, 0.0]);
    }
}
