//! Mean sines on the CPU: chunks of pixels over all cores, a vector register of them at a time.
//!
//! Sums have an order that depends on the picture alone, so the bytes are the same whatever the number of threads. Between
//! processors with and without fused multiplication and addition they differ in their last bits.
use rayon::prelude::*;

use super::kernel::{Differentiate, LANES, Slope, Wave, WeightedSums};
use super::plain::Distinct;
use crate::simd::Instructions;

/// Pixels of a task: their three colours fit the first cache, and one of each block fits a block.
const CHUNK: usize = LANES * LANES;
/// A cosine is the sine so many turns on.
pub(super) const QUARTER: f64 = 0.25;

/// Waves of filters `[waves][3]` and phases in radians, `shift` turns on.
pub(super) fn waves(filters: &[f32], phases: &[f32], shift: f64) -> Vec<Wave> {
    let wave = |(filter, phase): (&[f32; 3], &f32)| Wave::new(filter, *phase, shift);
    filters.as_chunks().0.iter().zip(phases).map(wave).collect()
}

/// `[views][waves]`, of pictures `[views][3][pixels]` with weights `[views][pixels]`; without, all weigh alike.
pub(super) fn means(
    instructions: Instructions,
    pictures: &[f32],
    views: usize,
    waves: &[Wave],
    weights: Option<&[f32]>,
) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let chunks = pixels.div_ceil(CHUNK);
    let sums: Vec<Vec<f32>> = (0..views * chunks)
        .into_par_iter()
        .map(|task| {
            let picture = &pictures[task / chunks * len..][..len];
            let first = task % chunks * CHUNK;
            let count = CHUNK.min(pixels - first);
            let distinct = Distinct::of(picture, first, count);
            let ones = [1.0; CHUNK];
            let of_pixels = weights.map_or(&ones[..], |weights| &weights[task / chunks * pixels + first..]);
            let mut sums = vec![0.0; waves.len()];
            instructions.run(WeightedSums {
                blocks: &distinct.blocks,
                weights: &distinct.weights(&of_pixels[..count]),
                waves,
                sums: &mut sums,
            });
            sums
        })
        .collect();
    let total = if weights.is_some() { 1.0 } else { pixels as f64 };
    let mean = |i: usize| {
        let (view, wave) = (i / waves.len(), i % waves.len());
        let of_view = sums[view * chunks..][..chunks].iter();
        (of_view.map(|sums| f64::from(sums[wave])).sum::<f64>() / total) as f32
    };
    (0..views * waves.len()).map(mean).collect()
}

/// `[views][3][pixels]`, for gradients `[views][waves]` and filters in radians; weights as in [`means`].
pub(super) fn gradients(
    instructions: Instructions,
    pictures: &[f32],
    views: usize,
    waves: &[Wave],
    filters: &[f32],
    weights: Option<&[f32]>,
    gradient: &[f32],
) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let chunks = pixels.div_ceil(CHUNK);
    let share = if weights.is_some() { 1.0 } else { 1.0 / pixels as f32 };
    let slopes: Vec<Slope> = (0..views * waves.len())
        .map(|i| {
            let wave = i % waves.len();
            let factor = gradient[i] * share;
            Slope {
                wave: waves[wave],
                weights: std::array::from_fn(|c| filters[3 * wave + c] * factor),
            }
        })
        .collect();
    let parts: Vec<Distinct> = (0..views * chunks)
        .into_par_iter()
        .map(|task| {
            let view = task / chunks;
            let first = task % chunks * CHUNK;
            let mut distinct = Distinct::of(&pictures[view * len..][..len], first, CHUNK.min(pixels - first));
            instructions.run(Differentiate {
                blocks: &mut distinct.blocks,
                slopes: &slopes[view * waves.len()..][..waves.len()],
            });
            distinct
        })
        .collect();
    let mut out = vec![0.0; pictures.len()];
    for (task, distinct) in parts.iter().enumerate() {
        let first = task % chunks * CHUNK;
        let picture = &mut out[task / chunks * len..][..len];
        for channel in 0..3 {
            let out = &mut picture[channel * pixels..][first..pixels.min(first + CHUNK)];
            distinct.spread(channel, out);
            if let Some(weights) = weights {
                let weights = &weights[task / chunks * pixels + first..];
                out.iter_mut().zip(weights).for_each(|(out, weight)| *out *= weight);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of pictures whose angles reach 300 radians, as the shipped tower's do: within what features may be off, on every
    /// instruction set that this machine has.
    #[test]
    fn every_instruction_set_agrees_with_the_formula() {
        let (views, pixels, count) = (2, 2500, 24);
        let noise = |i: usize, seed: usize| ((i * 7919 + seed * 104_729) % 10_007) as f32 / 5003.5 - 1.0;
        let pictures: Vec<f32> = (0..views * 3 * pixels).map(|i| 2.5 * noise(i, 1)).collect();
        let filters: Vec<f32> = (0..3 * count).map(|i| 40.0 * noise(i, 2)).collect();
        let phases: Vec<f32> = (0..count).map(|i| 3.0 * noise(i, 3)).collect();
        let gradient: Vec<f32> = (0..views * count).map(|i| noise(i, 4)).collect();
        let mut true_means = vec![0.0; views * count];
        let mut true_slopes = vec![0.0; pictures.len()];
        for (view, pixel) in (0..views).flat_map(|view| (0..pixels).map(move |pixel| (view, pixel))) {
            let at = |channel: usize| (view * 3 + channel) * pixels + pixel;
            for wave in 0..count {
                let filter = |channel: usize| f64::from(filters[3 * wave + channel]);
                let dot: f64 = (0..3).map(|c| filter(c) * f64::from(pictures[at(c)])).sum();
                let angle = dot + f64::from(phases[wave]);
                true_means[view * count + wave] += angle.sin() / pixels as f64;
                let slope = f64::from(gradient[view * count + wave]) * angle.cos() / pixels as f64;
                (0..3).for_each(|c| true_slopes[at(c)] += slope * filter(c));
            }
        }
        let largest = true_slopes.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let gap = |found: &[f32], expected: &[f64]| {
            let gaps = found.iter().zip(expected).map(|(f, e)| (f64::from(*f) - e).abs());
            gaps.fold(0.0, f64::max)
        };
        for set in Instructions::present() {
            let found = means(set, &pictures, views, &waves(&filters, &phases, 0.0), None);
            let off = gap(&found, &true_means);
            assert!(off < 2e-6, "{set:?}: {off}");
            let cosines = waves(&filters, &phases, QUARTER);
            let found = gradients(set, &pictures, views, &cosines, &filters, None, &gradient);
            let off = gap(&found, &true_slopes) / largest;
            assert!(off < 1e-5, "{set:?}: {off}");
        }
    }
}
