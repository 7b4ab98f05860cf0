//! The image tower's random filters, and its linear head in closed form.
//!
//! With N the covariance of the tower's averages from view to view, and S the mean of J Jt, where J is the averages'
//! gradient to the pixels, a direction v of feature space is moved by sqrt(vt S v) for a change of the picture of
//! length 1, while it varies by sqrt(vt N v) by itself. The head takes the directions of the largest ratio (a
//! generalised eigenproblem, as in linear discriminant analysis), scaled to a natural variation of 1.
use super::drawing::{draw, random_view};
use super::{IMAGE_SIZE, TrainOptions, TrainProgress, host};
use crate::clip::{ClipConfig, StatisticsTower, preprocess};
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::message::eigen;
use burn::tensor::{Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Side of a filter.
pub(super) const KERNEL: usize = 5;
/// Drawings whose gradients are measured.
const STEERED: usize = 16;
/// Weight of the variation between drawings beside that between views of one.
const BETWEEN: f64 = 0.1;
/// Smallest natural variance that is believed, against the largest.
const FLOOR: f64 = 1e-5;
/// Gain of the filters before the saturation, for pictures of unit deviation.
const GAIN: f32 = 2.2;
/// Pictures given to the tower at once.
const BATCH: usize = 64;

/// The head, and how strong its directions are.
pub(super) struct Head {
    /// `[averages][embed_dim]`.
    pub matrix: Vec<f32>,
    /// `[embed_dim]`.
    pub bias: Vec<f32>,
    /// Per direction, strongest first.
    pub steering: Vec<f64>,
}

/// Random filters without response to flat pictures, `[count][3][KERNEL][KERNEL]`, and biases `[count]`.
pub(super) fn filters(count: usize, seed: u64) -> (Vec<f32>, Vec<f32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut weights = Vec::with_capacity(count * 3 * KERNEL * KERNEL);
    for _ in 0..count {
        let mut filter: Vec<f32> = (0..3 * KERNEL * KERNEL)
            .map(|_| (0..4).map(|_| rng.random_range(-1.0..1.0_f32)).sum()) // nearly normal
            .collect();
        for channel in filter.chunks_exact_mut(KERNEL * KERNEL) {
            let mean = channel.iter().sum::<f32>() / channel.len() as f32;
            channel.iter_mut().for_each(|v| *v -= mean);
        }
        let norm = filter.iter().map(|v| v * v).sum::<f32>().sqrt();
        weights.extend(filter.iter().map(|v| GAIN * v / norm));
    }
    let biases = (0..count).map(|_| rng.random_range(-0.4..0.4)).collect();
    (weights, biases)
}

/// Fits the head to natural drawings.
pub(super) fn fit(
    tower: &StatisticsTower,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<Head> {
    let (natural, mean) = natural(tower, config, options, compute, progress)?;
    let n = mean.len();
    let gram = steering(tower, config, options, compute, n, progress)?;
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
    let turned = product(&product(&white, &gram, n), &transpose(&white, n), n);
    let steer = eigen::symmetric(turned, n).ok_or_else(failed)?;
    let kept = config.embed_dim;
    let head = product(&steer.vectors[..kept * n], &white, n);
    let bias = head.chunks_exact(n).map(|row| -eigen::dot(row, &mean) as f32).collect();
    Ok(Head {
        matrix: (0..n * kept).map(|i| head[i % kept * n + i / kept] as f32).collect(),
        bias,
        steering: steer.values[..kept].iter().map(|v| v.max(0.0).sqrt()).collect(),
    })
}

/// Covariance of the averages between views of a drawing, plus a share of that between drawings; and their mean.
fn natural(
    tower: &StatisticsTower,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<(Vec<f64>, Vec<f64>)> {
    let mut rows: Vec<f32> = Vec::new();
    let half = BATCH / 2;
    for first in (0..options.drawings).step_by(half) {
        let last = (first + half).min(options.drawings);
        let views: Vec<f32> = (first..last)
            .into_par_iter()
            .flat_map_iter(|index| {
                let drawing = draw(options.seed, index as u64);
                let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0x7669_6577);
                rng.set_stream(index as u64);
                (0..2)
                    .flat_map(move |_| random_view(&drawing, IMAGE_SIZE, &mut rng).0)
                    .collect::<Vec<_>>()
            })
            .collect();
        let shape = [2 * (last - first), 3, IMAGE_SIZE, IMAGE_SIZE];
        let pictures = Tensor::<4>::from_data(TensorData::new(views, shape), &compute.device);
        let input = preprocess(pictures, IMAGE_SIZE, &config.normalization);
        rows.extend(host(tower.statistics(&input), compute)?);
        progress(TrainProgress::Natural(last, options.drawings));
    }
    let n = rows.len() / (2 * options.drawings);
    let count = (2 * options.drawings) as f64;
    let mut mean = vec![0.0; n];
    for row in rows.chunks_exact(n) {
        mean.iter_mut().zip(row).for_each(|(m, &v)| *m += f64::from(v) / count);
    }
    let mut covariance = vec![0.0; n * n];
    let mut add = |row: &[f64], weight: f64| {
        for (i, out) in covariance.chunks_exact_mut(n).enumerate() {
            out.iter_mut().zip(row).for_each(|(o, v)| *o += weight * row[i] * v);
        }
    };
    for pair in rows.chunks_exact(2 * n) {
        let difference: Vec<f64> = (0..n).map(|i| f64::from(pair[i]) - f64::from(pair[n + i])).collect();
        add(&difference, 1.0 / count);
        for view in pair.chunks_exact(n) {
            let centred: Vec<f64> = view.iter().zip(&mean).map(|(&v, m)| f64::from(v) - m).collect();
            add(&centred, BETWEEN / count);
        }
    }
    Ok((covariance, mean))
}

/// Mean over drawings of J Jt, J the gradient of the averages to the object's pixels, `[n][n]`.
fn steering(
    tower: &StatisticsTower,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    n: usize,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<Vec<f64>> {
    let tracking = compute.device.clone().autodiff();
    let mut sum = vec![0.0; n * n];
    for index in 0..STEERED {
        let drawing = draw(options.seed ^ 0x7374_6565, index as u64);
        let mut rng = ChaCha8Rng::seed_from_u64(index as u64);
        let (view, mask) = random_view(&drawing, IMAGE_SIZE, &mut rng);
        let mut gradients = Vec::with_capacity(n);
        for first in (0..n).step_by(BATCH) {
            let count = BATCH.min(n - first);
            let shape = [count, 3, IMAGE_SIZE, IMAGE_SIZE];
            let pictures = Tensor::<4>::from_data(TensorData::new(view.repeat(count), shape), &tracking).require_grad();
            let statistics = tower.statistics(&preprocess(pictures.clone(), IMAGE_SIZE, &config.normalization));
            // Picture i is asked for the gradient of average first + i.
            let mut chosen = vec![0.0_f32; count * n];
            (0..count).for_each(|i| chosen[i * n + first + i] = 1.0);
            let chosen = Tensor::<2>::from_data(TensorData::new(chosen, [count, n]), &tracking);
            let all = (statistics * chosen).sum().backward();
            let gradient = pictures.grad(&all).ok_or_else(|| Error::Device {
                device: compute.name.clone(),
                reason: "the pictures have no gradient".into(),
            })?;
            let mask = Tensor::<4>::from_data(
                TensorData::new(mask.clone(), [1, 1, IMAGE_SIZE, IMAGE_SIZE]),
                &gradient.device(),
            );
            gradients.push((gradient * mask).reshape([count, 3 * IMAGE_SIZE * IMAGE_SIZE]));
        }
        let j = Tensor::cat(gradients, 0);
        let gram = host(j.clone().matmul(j.transpose()), compute)?;
        sum.iter_mut()
            .zip(gram)
            .for_each(|(s, g)| *s += f64::from(g) / STEERED as f64);
        progress(TrainProgress::Steering(index + 1, STEERED));
    }
    Ok(sum)
}

/// `a` (rows of `n`) times `b` (`n` x `n`).
fn product(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; a.len()];
    for (row, out) in a.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
        for (&x, b) in row.iter().zip(b.chunks_exact(n)) {
            out.iter_mut().zip(b).for_each(|(o, v)| *o += x * v);
        }
    }
    out
}

fn transpose(a: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|i| a[i % n * n + i / n]).collect()
}
