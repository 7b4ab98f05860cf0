//! Mean sines of a histogram: of colours that stand for many pixels each.
//!
//! Computed on the host whatever the device: a few thousand colours are too few to keep a card busy.
use super::cpu::waves;
use super::density;
use super::kernel::{Block, LANES, Lanes, Wave, WeightedSums};
use crate::simd::Instructions;

/// Filters and phases on the host.
#[derive(Clone, Debug)]
pub(in crate::clip) struct HostWaves(Vec<Wave>);

impl HostWaves {
    /// Of filters `[waves][3]` and phases, in radians.
    pub fn new(filters: &[f32], phases: &[f32]) -> Self {
        Self(waves(filters, phases, 0.0))
    }

    /// Mean sines of the waves of each scale, for normalised `colours` of each, `[3][n]`, of which each is there so many
    /// times. There are as many waves of each scale.
    pub fn means(&self, scales: &[(Vec<f32>, &[f32])], equalization: f32) -> Vec<f32> {
        let of_scale = self.0.len() / scales.len().max(1);
        let waves = self.0.chunks(of_scale.max(1));
        let of_scales = scales.iter().zip(waves);
        of_scales
            .flat_map(|((planes, counts), waves)| means(planes, counts, waves, equalization))
            .collect()
    }
}

fn means(planes: &[f32], counts: &[f32], waves: &[Wave], equalization: f32) -> Vec<f32> {
    let instructions = Instructions::widest();
    let weights = density::weights_of(instructions, planes, counts, equalization);
    let lanes = |values: &[f32]| -> Lanes { std::array::from_fn(|k| values.get(k).copied().unwrap_or(0.0)) };
    let [red, green, blue] = [0, 1, 2].map(|c| planes[c * counts.len()..][..counts.len()].chunks(LANES));
    let blocks: Vec<Block> = red
        .zip(green)
        .zip(blue)
        .map(|((red, green), blue)| Block([lanes(red), lanes(green), lanes(blue)]))
        .collect();
    let mut sums = vec![0.0; waves.len()];
    instructions.run(WeightedSums {
        blocks: &blocks,
        weights: &weights.chunks(LANES).map(lanes).collect::<Vec<_>>(),
        waves,
        sums: &mut sums,
    });
    sums
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor, TensorData};

    use super::*;
    use crate::clip::sines::mean_sines;

    #[test]
    fn colours_that_count_often_are_pixels_that_are_there_so_often() {
        // Forty colours, the first once, the second twice...
        let noise = |i: usize, seed: usize| ((i * 7919 + seed * 104_729) % 10_007) as f32 / 5003.5 - 1.0;
        let (distinct, waves) = (40, 12);
        let value = |channel: usize, colour: usize| 1.8 * noise(3 * colour + channel, 1);
        let colours: Vec<usize> = (0..distinct).flat_map(|colour| vec![colour; colour + 1]).collect();
        let planes = |colours: &[usize]| -> Vec<f32> {
            (0..3)
                .flat_map(|channel| colours.iter().map(move |colour| value(channel, *colour)))
                .collect()
        };
        let filters: Vec<f32> = (0..3 * waves).map(|i| 40.0 * noise(i, 2)).collect();
        let phases: Vec<f32> = (0..waves).map(|i| 3.0 * noise(i, 3)).collect();
        let device = Device::default();
        let tensor = |values: &[f32], shape: &[usize]| TensorData::new(values.to_vec(), shape.to_vec());
        let pixels = colours.len();
        for equalization in [0.0, 0.2, 1.0] {
            let found = HostWaves::new(&filters, &phases).means(
                &[(
                    planes(&(0..distinct).collect::<Vec<_>>()),
                    &(1..=distinct).map(|count| count as f32).collect::<Vec<_>>(),
                )],
                equalization,
            );
            let of_picture = mean_sines(
                Tensor::from_data(tensor(&planes(&colours), &[1, 3, 1, pixels]), &device),
                Tensor::from_data(tensor(&filters, &[waves, 3]), &device),
                Tensor::from_data(tensor(&phases, &[waves]), &device),
                vec![1],
                equalization,
            );
            let of_picture: Vec<f32> = of_picture.into_data().iter::<f32>().collect();
            for (a, b) in found.iter().zip(&of_picture) {
                assert!((a - b).abs() < 1e-5, "{equalization}: {a} {b}");
            }
        }
    }
}
