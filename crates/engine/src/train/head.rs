//! The image tower's linear head, in closed form.
//!
//! With N how the tower's averages vary from view to view of a scene (their covariance, and a share of the squares of
//! the means of scenes), and S what a mark can do to them in views it was not fitted to ([`super::steering`]), a
//! direction v of feature space moves by sqrt(vt S v) for a change of the picture of length 1, while it varies by
//! sqrt(vt N v) by itself. The head takes the directions of the largest ratio (a generalised eigenproblem, as in linear
//! discriminant analysis), scaled to a natural variation of 1. It has no bias: an empty picture is 0, so that how much
//! of a picture a scene fills changes the length of a feature and not its direction.
use super::scenes::ViewedScene;
use super::steering::across_views;
use super::{IMAGE_SIZE, TrainOptions, TrainProgress, host};
use crate::clip::{ClipConfig, RandomFourierEncoder, preprocess};
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::extract::rasterizer;
use crate::message::eigen;
use crate::message::matrix::{congruence, dot, product};
use crate::picture::Picture;
use crate::quality::batch;
use std::ops::Range;

/// Grounds that scenes are seen over, one a view; a feature that follows the ground is of no use.
const GROUNDS: [f32; 6] = [1.0, 1.0, 0.0, 1.0, 0.5, 0.0];
/// Views of a scene whose gradients are measured.
const STEERED_VIEWS: usize = 5;
/// Weight of the squared means of scenes beside the variation between views of one.
const BETWEEN: f64 = 0.3;
/// Share of that of which only the diagonal is taken (Ledoit and Wolf 2004): a few hundred scenes do not tell how the
/// means of as many filters go together, and the head would find combinations that vanish in these scenes only.
const SHRUNK: f64 = 0.5;
/// Noise on constant coefficients of the scenes whose gradients are measured, where filters see contrasts.
const GRAIN: f32 = 0.15;
/// Scenes on which the head is measured, not those it is fitted to, and those of their gradients.
const MEASURED: u64 = 160;
const STEERED_MEASURED: u64 = 8;
/// Smallest natural variance that is believed, against the largest.
const FLOOR: f64 = 1e-6;

/// The head, and how strong its directions are.
pub(super) struct Head {
    /// `[averages][embed_dim]`.
    pub matrix: Vec<f32>,
    /// `[embed_dim]`, zeros.
    pub bias: Vec<f32>,
    /// How far a change of length 1 moves each direction, in standard deviations of its natural variation in scenes that
    /// the head was not fitted to.
    pub steering: Vec<f64>,
}

/// Fits the head to sample scenes.
pub(super) fn fit(
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<Head> {
    let scenes = options.scenes as u64;
    let fitted = natural(tower, config, options, 0..scenes, compute, progress)?;
    let first = scenes + options.steered as u64;
    let unseen = natural(tower, config, options, first..first + MEASURED, compute, &mut |_| ())?;
    let n = fitted.len().isqrt();
    let of_gradients = first + MEASURED;
    let gradients = |scenes, progress: &mut dyn FnMut(TrainProgress)| {
        steering(tower, config, options, scenes, compute, n, progress)
    };
    let steered = gradients(scenes..first, progress)?;
    let unseen_steered = gradients(of_gradients..of_gradients + STEERED_MEASURED, &mut |_| ())?;
    let failed = || Error::BadModel {
        name: "head".into(),
        reason: "features have no principal directions".into(),
    };
    let noise = eigen::symmetric(fitted, n).ok_or_else(failed)?;
    let floor = noise.values[0].max(f64::MIN_POSITIVE) * FLOOR;
    // Rows of `white` turn averages into coordinates of unit natural variation.
    let white: Vec<f64> = (0..n * n)
        .map(|i| noise.vectors[i] / noise.values[i / n].max(floor).sqrt())
        .collect();
    let turned = congruence(&white, &steered, n);
    let steer = eigen::symmetric(turned, n).ok_or_else(failed)?;
    let kept = config.embed_dim;
    let head = product(&steer.vectors[..kept * n], &white, n, n);
    let along =
        |matrix: &[f64], v: &[f64]| -> f64 { matrix.chunks_exact(n).zip(v).map(|(row, x)| x * dot(row, v)).sum() };
    let reach = |v: &[f64]| (along(&unseen_steered, v) / along(&unseen, v)).max(0.0).sqrt();
    Ok(Head {
        matrix: (0..n * kept).map(|i| head[i % kept * n + i / kept] as f32).collect(),
        bias: vec![0.0; kept],
        steering: head.chunks_exact(n).map(reach).collect(),
    })
}

/// Covariance of the averages between views of a scene, plus a share of the squared means of scenes, `[n][n]`.
fn natural(
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    options: &TrainOptions,
    scenes: Range<u64>,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<Vec<f64>> {
    let rasterizer = rasterizer(compute)?;
    let views = GROUNDS.len();
    let count = (scenes.end - scenes.start) as usize;
    let mut sum = Vec::new();
    for (done, index) in scenes.enumerate() {
        let scene = ViewedScene::new(options, index, views, 0.0)?;
        let pictures: Vec<Picture> = scene
            .views
            .iter()
            .zip(&GROUNDS)
            .map(|(view, &ground)| scene.picture(rasterizer.as_ref(), view, ground))
            .collect::<Result<_>>()?;
        let pictures = batch(&pictures.iter().collect::<Vec<_>>(), &compute.device)?;
        let input = preprocess(pictures, IMAGE_SIZE, &config.normalization);
        let rows: Vec<f64> = host(tower.statistics(&input), compute)?
            .into_iter()
            .map(f64::from)
            .collect();
        let n = rows.len() / views;
        sum.resize(n * n, 0.0);
        let mean = mean(&rows, n);
        let share = 1.0 / count as f64;
        for row in rows.chunks_exact(n) {
            let centred: Vec<f64> = row.iter().zip(&mean).map(|(v, m)| v - m).collect();
            add_square(&mut sum, &centred, share / (views - 1) as f64);
        }
        add_square(&mut sum, &mean, share * BETWEEN * (1.0 - SHRUNK));
        for (i, v) in mean.iter().enumerate() {
            sum[i * n + i] += share * BETWEEN * SHRUNK * v * v;
        }
        progress(TrainProgress::Natural(done + 1, count));
    }
    Ok(sum)
}

/// Mean of rows of `n`.
fn mean(rows: &[f64], n: usize) -> Vec<f64> {
    let count = (rows.len() / n) as f64;
    let mut mean = vec![0.0; n];
    for row in rows.chunks_exact(n) {
        mean.iter_mut().zip(row).for_each(|(m, v)| *m += v / count);
    }
    mean
}

/// Adds `weight v vt`.
fn add_square(sum: &mut [f64], v: &[f64], weight: f64) {
    for (row, x) in sum.chunks_exact_mut(v.len()).zip(v) {
        row.iter_mut().zip(v).for_each(|(sum, y)| *sum += weight * x * y);
    }
}

/// Mean over scenes of what a mark can do across views, `[n][n]`.
fn steering(
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    options: &TrainOptions,
    scenes: Range<u64>,
    compute: &Compute,
    n: usize,
    progress: &mut dyn FnMut(TrainProgress),
) -> Result<Vec<f64>> {
    let rasterizer = rasterizer(compute)?;
    let count = (scenes.end - scenes.start) as usize;
    let mut sum = vec![0.0; n * n];
    // Contrasts of what is alike all around have no gradient: a mark begins with grain.
    let grain = if options.surround > 1 { GRAIN } else { 0.0 };
    for (done, index) in scenes.enumerate() {
        let scene = ViewedScene::new(options, index, STEERED_VIEWS, grain)?;
        let found = across_views(&scene, tower, config, rasterizer.as_ref(), compute, n)?;
        sum.iter_mut().zip(found).for_each(|(s, f)| *s += f / count as f64);
        progress(TrainProgress::Steering(done + 1, count));
    }
    Ok(sum)
}
