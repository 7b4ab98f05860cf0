//! The image tower's linear head, in closed form.
//!
//! With N the covariance of the tower's averages from view to view of a scene (and a share of that between scenes),
//! and S what a mark can do to them in views it was not fitted to ([`super::steering`]), a direction v of feature space
//! moves by sqrt(vt S v) for a change of the picture of length 1, while it varies by sqrt(vt N v) by itself. The head
//! takes the directions of the largest ratio (a generalised eigenproblem, as in linear discriminant analysis), scaled
//! to a natural variation of 1.
use super::scenes::ViewedScene;
use super::steering::across_views;
use super::{IMAGE_SIZE, TrainOptions, TrainProgress, host};
use crate::clip::{ClipConfig, StatisticsTower, preprocess};
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::extract::rasterizer;
use crate::message::eigen;
use crate::message::matrix::{congruence, dot, product};
use crate::picture::Picture;
use crate::quality::batch;

/// Grounds that scenes are seen over, one a view; a feature that follows the ground is of no use.
const GROUNDS: [f32; 6] = [1.0, 1.0, 0.0, 1.0, 0.5, 0.0];
/// Scenes whose gradients are measured, and views of each.
const STEERED: usize = 3;
const STEERED_VIEWS: usize = 5;
/// Weight of the variation between scenes beside that between views of one.
const BETWEEN: f64 = 0.3;
/// Smallest natural variance that is believed, against the largest.
const FLOOR: f64 = 1e-6;

/// The head, and how strong its directions are.
pub(super) struct Head {
    /// `[averages][embed_dim]`.
    pub matrix: Vec<f32>,
    /// `[embed_dim]`.
    pub bias: Vec<f32>,
    /// Per direction, strongest first.
    pub steering: Vec<f64>,
}

/// Fits the head to sample scenes.
pub(super) fn fit(
    tower: &StatisticsTower,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<Head> {
    let (natural, mean) = natural(tower, config, options, compute, progress)?;
    let n = mean.len();
    let steering = steering(tower, config, options, compute, n, progress)?;
    let failed = || Error::BadModel {
        name: "head".into(),
        reason: "features have no principal directions".into(),
    };
    let noise = eigen::symmetric(natural, n).ok_or_else(failed)?;
    let floor = noise.values[0].max(f64::MIN_POSITIVE) * FLOOR;
    // Rows of `white` turn averages into coordinates of unit natural variation.
    let white: Vec<f64> = (0..n * n)
        .map(|i| noise.vectors[i] / noise.values[i / n].max(floor).sqrt())
        .collect();
    let turned = congruence(&white, &steering, n);
    let steer = eigen::symmetric(turned, n).ok_or_else(failed)?;
    let kept = config.embed_dim;
    let head = product(&steer.vectors[..kept * n], &white, n, n);
    let bias = head.chunks_exact(n).map(|row| -dot(row, &mean) as f32).collect();
    Ok(Head {
        matrix: (0..n * kept).map(|i| head[i % kept * n + i / kept] as f32).collect(),
        bias,
        steering: steer.values[..kept].iter().map(|v| v.max(0.0).sqrt()).collect(),
    })
}

/// Covariance of the averages between views of a scene, plus a share of that between scenes; and the mean of all.
fn natural(
    tower: &StatisticsTower,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<(Vec<f64>, Vec<f64>)> {
    let rasterizer = rasterizer(compute)?;
    let views = GROUNDS.len();
    let mut means: Vec<Vec<f64>> = Vec::with_capacity(options.scenes);
    let mut covariance = Vec::new();
    for index in 0..options.scenes {
        let scene = ViewedScene::new(options.seed, index as u64, views)?;
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
        covariance.resize(n * n, 0.0);
        let mean = mean(&rows, n);
        add_covariance(&mut covariance, &rows, &mean, 1.0 / options.scenes as f64);
        means.push(mean);
        progress(TrainProgress::Natural(index + 1, options.scenes));
    }
    let rows: Vec<f64> = means.concat();
    let mean = mean(&rows, rows.len() / options.scenes);
    add_covariance(&mut covariance, &rows, &mean, BETWEEN);
    Ok((covariance, mean))
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

/// Adds `weight` times the covariance of rows around their mean.
fn add_covariance(sum: &mut [f64], rows: &[f64], mean: &[f64], weight: f64) {
    let n = mean.len();
    let scale = weight / (rows.len() / n - 1) as f64;
    for row in rows.chunks_exact(n) {
        let centred: Vec<f64> = row.iter().zip(mean).map(|(v, m)| v - m).collect();
        for (i, out) in sum.chunks_exact_mut(n).enumerate() {
            out.iter_mut()
                .zip(&centred)
                .for_each(|(o, v)| *o += scale * centred[i] * v);
        }
    }
}

/// Mean over scenes of what a mark can do across views, `[n][n]`.
fn steering(
    tower: &StatisticsTower,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    n: usize,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<Vec<f64>> {
    let rasterizer = rasterizer(compute)?;
    let mut sum = vec![0.0; n * n];
    for index in 0..STEERED {
        // Other scenes than those of the natural variation.
        let scene = ViewedScene::new(options.seed, (options.scenes + index) as u64, STEERED_VIEWS)?;
        let found = across_views(&scene, tower, config, rasterizer.as_ref(), compute, n)?;
        sum.iter_mut().zip(found).for_each(|(s, f)| *s += f / STEERED as f64);
        progress(TrainProgress::Steering(index + 1, STEERED));
    }
    Ok(sum)
}
