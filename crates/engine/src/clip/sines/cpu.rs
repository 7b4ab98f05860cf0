//! Mean sines on the CPU: chunks of pixels over all cores, eight to sixteen at a time in vector registers.
//!
//! Sums have an order that depends on sizes alone, and no multiplication is fused with an addition, so the bytes are
//! the same whatever the number of threads and the width of the registers.
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{Shape, TensorData};
use rayon::prelude::*;

use super::{FloatTensor, MeanSines, MeanSinesBackward, TURN};

/// Pixels of a task: their three colours fit the first cache.
const CHUNK: usize = 1024;
/// Pixels that are computed together.
const LANES: usize = 16;

/// Coefficients of r, r^3, r^5... of sin r: the minimax polynomial over [-pi, pi], within 1.2e-9, in f32 within 5e-7.
const SINE: [f32; 7] = [
    1.0,
    -1.666_666_4e-1,
    8.333_310_5e-3,
    -1.984_015_1e-4,
    2.752_937_5e-6,
    -2.467_626_1e-8,
    1.344_908_5e-10,
];

type Lanes = [f32; LANES];

impl MeanSines for Flex {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [views, filters_count] = [pictures.shape()[0], phases.shape()[0]];
        let (pictures, filters, phases) = (floats(pictures), floats(filters), floats(phases));
        let waves = waves(&filters, &phases, 0.0);
        let means = means(&pictures, views, &waves);
        FloatTensor::<Self>::from_data(TensorData::new(means, Shape::new([views, filters_count])))
    }
}

impl MeanSinesBackward for Flex {
    fn mean_sines_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let shape = pictures.shape();
        let (pictures, filters) = (floats(pictures), floats(filters));
        // The derivative of sine is the sine a quarter turn on.
        let waves = waves(&filters, &floats(phases), std::f32::consts::FRAC_PI_2);
        let found = gradients(&pictures, shape[0], &waves, &floats(gradient));
        FloatTensor::<Self>::from_data(TensorData::new(found, shape))
    }
}

/// A tensor's numbers, row by row.
fn floats(tensor: FloatTensor<Flex>) -> Vec<f32> {
    tensor.to_contiguous().storage::<f32>().to_vec()
}

/// A filter and its phase.
struct Wave {
    filter: [f32; 3],
    phase: f32,
}

fn waves(filters: &[f32], phases: &[f32], shift: f32) -> Vec<Wave> {
    let wave = |(filter, phase): (&[f32; 3], &f32)| Wave {
        filter: *filter,
        phase: phase + shift,
    };
    filters.as_chunks::<3>().0.iter().zip(phases).map(wave).collect()
}

/// Pixels `first..first + count` of a planar picture, padded with zeros to whole blocks: `[blocks][3]` of lanes.
fn blocks(picture: &[f32], first: usize, count: usize) -> Vec<[Lanes; 3]> {
    let pixels = picture.len() / 3;
    let block = |start: usize| {
        let mut block = [[0.0; LANES]; 3];
        let end = (start + LANES).min(first + count);
        for (channel, lanes) in block.iter_mut().enumerate() {
            let plane = &picture[channel * pixels..][start..end];
            lanes[..plane.len()].copy_from_slice(plane);
        }
        block
    };
    (first..first + count).step_by(LANES).map(block).collect()
}

/// `[views][waves]`.
fn means(pictures: &[f32], views: usize, waves: &[Wave]) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let chunks = pixels.div_ceil(CHUNK);
    let sums: Vec<Vec<f32>> = (0..views * chunks)
        .into_par_iter()
        .map(|task| {
            let picture = &pictures[task / chunks * len..][..len];
            let first = task % chunks * CHUNK;
            let count = CHUNK.min(pixels - first);
            let blocks = blocks(picture, first, count);
            let mut sums = vec![0.0; waves.len()];
            pulp::Arch::new().dispatch(|| add_sines(&blocks, count, waves, &mut sums));
            sums
        })
        .collect();
    let mean = |i: usize| {
        let (view, wave) = (i / waves.len(), i % waves.len());
        let of_view = sums[view * chunks..][..chunks].iter();
        (of_view.map(|sums| f64::from(sums[wave])).sum::<f64>() / pixels as f64) as f32
    };
    (0..views * waves.len()).map(mean).collect()
}

/// Sums over the first `count` pixels of blocks, a wave after the other.
#[inline(always)]
fn add_sines(blocks: &[[Lanes; 3]], count: usize, waves: &[Wave], sums: &mut [f32]) {
    let whole = count / LANES;
    for (wave, sum) in waves.iter().zip(sums) {
        let mut lanes = [0.0; LANES];
        for block in &blocks[..whole] {
            let sines = sines(block, wave);
            for (lane, sine) in lanes.iter_mut().zip(sines) {
                *lane += sine;
            }
        }
        if let Some(block) = blocks.get(whole) {
            let sines = sines(block, wave);
            for (lane, sine) in lanes.iter_mut().zip(sines).take(count % LANES) {
                *lane += sine;
            }
        }
        *sum = lanes.iter().sum();
    }
}

/// `[views][3][pixels]`, for gradients `[views][waves]`.
fn gradients(pictures: &[f32], views: usize, waves: &[Wave], gradient: &[f32]) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let chunks = pixels.div_ceil(CHUNK);
    let parts: Vec<Vec<[Lanes; 3]>> = (0..views * chunks)
        .into_par_iter()
        .map(|task| {
            let picture = &pictures[task / chunks * len..][..len];
            let first = task % chunks * CHUNK;
            let mut blocks = blocks(picture, first, CHUNK.min(pixels - first));
            let gradient = &gradient[task / chunks * waves.len()..][..waves.len()];
            pulp::Arch::new().dispatch(|| differentiate(&mut blocks, waves, gradient, 1.0 / pixels as f32));
            blocks
        })
        .collect();
    let mut out = vec![0.0; pictures.len()];
    let tasks = parts.iter().enumerate();
    for (task, blocks) in tasks {
        let first = task % chunks * CHUNK;
        let picture = &mut out[task / chunks * len..][..len];
        for (index, block) in blocks.iter().enumerate() {
            let start = first + index * LANES;
            let count = LANES.min(pixels - start);
            for (channel, lanes) in block.iter().enumerate() {
                picture[channel * pixels + start..][..count].copy_from_slice(&lanes[..count]);
            }
        }
    }
    out
}

/// Puts gradients in the place of colours.
#[inline(always)]
fn differentiate(blocks: &mut [[Lanes; 3]], waves: &[Wave], gradient: &[f32], scale: f32) {
    for block in blocks {
        let mut sums = [[0.0; LANES]; 3];
        for (wave, gradient) in waves.iter().zip(gradient) {
            let cosines = sines(block, wave);
            for (sum, weight) in sums.iter_mut().zip(wave.filter) {
                let weight = weight * gradient * scale;
                for (sum, cosine) in sum.iter_mut().zip(cosines) {
                    *sum += weight * cosine;
                }
            }
        }
        *block = sums;
    }
}

/// Sine of a wave at the pixels of a block.
#[inline(always)]
fn sines(block: &[Lanes; 3], wave: &Wave) -> Lanes {
    /// Adding and subtracting 1.5 * 2^23 rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    let [red, green, blue] = wave.filter;
    let mut out = [0.0; LANES];
    for (i, out) in out.iter_mut().enumerate() {
        let angle = red * block[0][i] + green * block[1][i] + blue * block[2][i] + wave.phase;
        let turns = (angle * std::f32::consts::FRAC_1_PI * 0.5 + ROUND) - ROUND;
        let r = angle - turns * TURN[0] - turns * TURN[1];
        let z = r * r;
        let mut value = SINE[6];
        for coefficient in SINE[..6].iter().rev() {
            value = value * z + coefficient;
        }
        *out = value * r;
    }
    out
}
