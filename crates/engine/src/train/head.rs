//! The image tower's linear head, in closed form.
//!
//! With N how the tower's averages vary by themselves: from view to view of a scene, by what people do to pictures, and
//! from scene to scene ([`super::variation`]), and S what a mark can do to them in views it was not fitted to
//! ([`super::steering`]) that is left after what people do, a direction v of feature space moves by sqrt(vt S v) for a
//! change of the picture of length 1, while it varies by sqrt(vt N v) by itself. The head takes the directions of the largest ratio (a generalised eigenproblem, as in linear
//! discriminant analysis), scaled to a natural variation of 1. It has no bias: an empty picture is 0, so that how much
//! of a picture a scene fills changes the length of a feature and not its direction.
use super::scenes::{Detail, ViewedScene};
use super::steering::across_views;
use super::variation::Variation;
use super::{TrainOptions, TrainProgress};
use crate::clip::{ClipConfig, RandomFourierEncoder};
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::extract::rasterizer;
use crate::message::eigen;
use crate::message::matrix::{congruence, dot, product};
use std::ops::Range;

/// Views of a scene whose gradients are measured.
const STEERED_VIEWS: usize = 5;
/// Noise on constant coefficients of the scenes whose gradients are measured, where filters see contrasts.
const GRAIN: f32 = 0.15;
/// Scenes on which the head is measured, not those it is fitted to, and those of their gradients.
const MEASURED: u64 = 24;
const STEERED_MEASURED: u64 = 6;
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
    let fitted = Variation::measure(tower, config, options, 0..scenes, compute, progress)?;
    let first = scenes + options.steered as u64;
    let unseen = Variation::measure(tower, config, options, first..first + MEASURED, compute, &mut |_| ())?;
    let n = fitted.left.len();
    let of_gradients = first + MEASURED;
    let gradients = |scenes, left: &[f64], progress: &mut dyn FnMut(TrainProgress)| {
        steering(tower, config, options, scenes, compute, left, progress)
    };
    let steered = gradients(scenes..first, &fitted.left, progress)?;
    let unseen_steered = gradients(of_gradients..of_gradients + STEERED_MEASURED, &unseen.left, &mut |_| ())?;
    let failed = || Error::BadModel {
        name: "head".into(),
        reason: "features have no principal directions".into(),
    };
    let noise = eigen::symmetric(fitted.covariance, n).ok_or_else(failed)?;
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
    let reach = |v: &[f64]| {
        (along(&unseen_steered, v) / along(&unseen.covariance, v))
            .max(0.0)
            .sqrt()
    };
    Ok(Head {
        matrix: (0..n * kept).map(|i| head[i % kept * n + i / kept] as f32).collect(),
        bias: vec![0.0; kept],
        steering: head.chunks_exact(n).map(reach).collect(),
    })
}

/// Mean over scenes of what a mark can do across views, of each average the share that is `left`, `[n][n]`.
fn steering(
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    options: &TrainOptions,
    scenes: Range<u64>,
    compute: &Compute,
    left: &[f64],
    progress: &mut dyn FnMut(TrainProgress),
) -> Result<Vec<f64>> {
    let rasterizer = rasterizer(compute)?;
    let count = (scenes.end - scenes.start) as usize;
    let n = left.len();
    let mut sum = vec![0.0; n * n];
    // Contrasts of what is alike all around have no gradient: a mark begins with grain.
    let grain = if options.surround > 1 { GRAIN } else { 0.0 };
    for (done, index) in scenes.enumerate() {
        let scene = ViewedScene::new(options, index, STEERED_VIEWS, Detail::small(grain))?;
        let found = across_views(&scene, tower, config, rasterizer.as_ref(), compute, n)?;
        for (i, (sum, found)) in sum.iter_mut().zip(found).enumerate() {
            *sum += left[i / n] * left[i % n] * found / count as f64;
        }
        progress(TrainProgress::Steering(done + 1, count));
    }
    Ok(sum)
}
