//! Mean sines on the CPU: chunks of pixels over all cores, a vector register of them at a time.
//!
//! Sums have an order that depends on sizes alone, so the bytes are the same whatever the number of threads. Between
//! processors with and without fused multiplication and addition they differ in their last bits.
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{Shape, TensorData};
use rayon::prelude::*;

use super::kernel::{Block, Differentiate, LANES, Slope, Sums, Wave};
use super::pool::Squares;
use super::{FloatTensor, MeanSines, MeanSinesBackward};
use crate::simd::Instructions;

/// Pixels of a task: their three colours fit the first cache.
const CHUNK: usize = 1024;
/// A cosine is the sine so many turns on.
const QUARTER: f64 = 0.25;

impl MeanSines for Flex {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let (squares, views) = (squares(&pictures, side), pictures.shape()[0]);
        let shape = Shape::new([views, phases.shape()[0]]);
        let [pictures, filters, phases] = [pictures, filters, phases].map(|t| t.to_contiguous());
        let waves = waves(filters.storage(), phases.storage(), 0.0);
        let pictures = squares.means(pictures.storage());
        let means = means(Instructions::widest(), &pictures, views, &waves);
        FloatTensor::<Self>::from_data(TensorData::new(means, shape))
    }
}

impl MeanSinesBackward for Flex {
    fn mean_sines_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let (squares, shape) = (squares(&pictures, side), pictures.shape());
        let tensors = [pictures, filters, phases, gradient];
        let [pictures, filters, phases, gradient] = tensors.map(|t| t.to_contiguous());
        let filters: &[f32] = filters.storage();
        let waves = waves(filters, phases.storage(), QUARTER);
        let pictures = squares.means(pictures.storage());
        let instructions = Instructions::widest();
        let found = gradients(instructions, &pictures, shape[0], &waves, filters, gradient.storage());
        FloatTensor::<Self>::from_data(TensorData::new(squares.spread(found), shape))
    }
}

/// Means and their gradient to the pictures with chosen instructions.
#[cfg(test)]
pub(super) fn with(
    instructions: Instructions,
    pictures: &[f32],
    views: usize,
    filters: &[f32],
    phases: &[f32],
    gradient: &[f32],
) -> (Vec<f32>, Vec<f32>) {
    let sines = waves(filters, phases, 0.0);
    let cosines = waves(filters, phases, QUARTER);
    (
        means(instructions, pictures, views, &sines),
        gradients(instructions, pictures, views, &cosines, filters, gradient),
    )
}

fn squares(pictures: &FloatTensor<Flex>, side: usize) -> Squares {
    let shape = pictures.shape();
    Squares {
        height: shape[2],
        width: shape[3],
        side,
    }
}

fn waves(filters: &[f32], phases: &[f32], shift: f64) -> Vec<Wave> {
    let wave = |(filter, phase): (&[f32; 3], &f32)| Wave::new(filter, *phase, shift);
    filters.as_chunks().0.iter().zip(phases).map(wave).collect()
}

/// Pixels `first..first + count` of a planar picture, padded with zeros to whole blocks.
fn blocks(picture: &[f32], first: usize, count: usize) -> Vec<Block> {
    let pixels = picture.len() / 3;
    let block = |start: usize| {
        let mut block = Block([[0.0; LANES]; 3]);
        let end = (start + LANES).min(first + count);
        for (channel, lanes) in block.0.iter_mut().enumerate() {
            let plane = &picture[channel * pixels..][start..end];
            lanes[..plane.len()].copy_from_slice(plane);
        }
        block
    };
    (first..first + count).step_by(LANES).map(block).collect()
}

/// `[views][waves]`.
fn means(instructions: Instructions, pictures: &[f32], views: usize, waves: &[Wave]) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let chunks = pixels.div_ceil(CHUNK);
    let sums: Vec<Vec<f32>> = (0..views * chunks)
        .into_par_iter()
        .map(|task| {
            let picture = &pictures[task / chunks * len..][..len];
            let first = task % chunks * CHUNK;
            let count = CHUNK.min(pixels - first);
            let mut sums = vec![0.0; waves.len()];
            instructions.run(Sums {
                blocks: &blocks(picture, first, count),
                count,
                waves,
                sums: &mut sums,
            });
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

/// `[views][3][pixels]`, for gradients `[views][waves]` and filters in radians.
fn gradients(
    instructions: Instructions,
    pictures: &[f32],
    views: usize,
    waves: &[Wave],
    filters: &[f32],
    gradient: &[f32],
) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let chunks = pixels.div_ceil(CHUNK);
    let slopes: Vec<Slope> = (0..views * waves.len())
        .map(|i| {
            let wave = i % waves.len();
            let factor = gradient[i] / pixels as f32;
            Slope {
                wave: waves[wave],
                weights: std::array::from_fn(|c| filters[3 * wave + c] * factor),
            }
        })
        .collect();
    let parts: Vec<Vec<Block>> = (0..views * chunks)
        .into_par_iter()
        .map(|task| {
            let view = task / chunks;
            let first = task % chunks * CHUNK;
            let mut blocks = blocks(&pictures[view * len..][..len], first, CHUNK.min(pixels - first));
            instructions.run(Differentiate {
                blocks: &mut blocks,
                slopes: &slopes[view * waves.len()..][..waves.len()],
            });
            blocks
        })
        .collect();
    let mut out = vec![0.0; pictures.len()];
    for (task, blocks) in parts.iter().enumerate() {
        let first = task % chunks * CHUNK;
        let picture = &mut out[task / chunks * len..][..len];
        for (index, Block(block)) in blocks.iter().enumerate() {
            let start = first + index * LANES;
            let count = LANES.min(pixels - start);
            for (channel, lanes) in block.iter().enumerate() {
                picture[channel * pixels + start..][..count].copy_from_slice(&lanes[..count]);
            }
        }
    }
    out
}
