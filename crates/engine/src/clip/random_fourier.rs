//! Image tower of local statistics: which colours a picture has, at several scales, wherever they stand in it.
//!
//! The picture at several scales passes a layer of filters of one pixel; the response y of filter i becomes
//! sin(y + phase_i) and is averaged over the whole picture, and a linear head turns the averages into the feature. The
//! averages are random Fourier features (Rahimi and Recht 2007) of the distribution of colours, its characteristic
//! function at random frequencies. The frequencies are so high that natural colours turn the sine many times: the
//! average over many pixels then varies little from view to view, while a small change of a surface's colour moves it
//! alike from wherever it is seen. (Quantisation index modulation, Chen and Wornell 2001, rejects the interference of
//! its host in the same way.) The sine is a whole number of half turns at black and at white, so that a ground of
//! either adds nothing, and a feature's direction does not depend on how much of the picture a scene fills.
use super::config::VisionConfig;
use super::params::param;
use super::sines::mean_sines;
use super::weights::set;
use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Device, Tensor};
use std::ops::Range;

/// Image tower of the statistics kind.
#[derive(Module, Debug)]
pub struct RandomFourierEncoder {
    scales: Vec<Scale>,
    proj: Linear,
}

/// The filters of one scale.
#[derive(Module, Debug)]
struct Scale {
    /// `[filters, 3, kernel, kernel]`.
    weight: Param<Tensor<4>>,
    /// Phases `[filters]`, added before the sine.
    bias: Param<Tensor<1>>,
    /// Side of the square that is averaged into one pixel of this scale.
    size: usize,
    /// Side of the square whose mean is subtracted from a pixel.
    surround: usize,
}

impl RandomFourierEncoder {
    /// Lays out the tower; `embed_dim` is the width of its features.
    pub fn new(
        vision: &VisionConfig,
        scales: &[usize],
        kernel: usize,
        surround: usize,
        embed_dim: usize,
        device: &Device,
    ) -> Self {
        let filters = vision.width;
        let scale = |&size: &usize| Scale {
            weight: param([filters, 3, kernel, kernel], device),
            bias: param([filters], device),
            size,
            surround,
        };
        Self {
            scales: scales.iter().map(scale).collect(),
            proj: LinearConfig::new(filters * scales.len(), embed_dim).init(device),
        }
    }

    /// Average responses `[batch, scales * filters]` of normalised pictures `[batch, 3, h, w]`.
    pub fn statistics(&self, pictures: &Tensor<4>) -> Tensor<2> {
        let of_scale = |scale: &Scale| scale.statistics(pictures.clone());
        Tensor::cat(self.scales.iter().map(of_scale).collect(), 1)
    }

    /// Average responses `[batch, filters.len()]` of some filters of one scale.
    pub fn statistics_of(&self, scale: usize, filters: Range<usize>, pictures: &Tensor<4>) -> Tensor<2> {
        let scale = &self.scales[scale];
        let weight = scale.weight.val().slice([filters.clone()]);
        let phases = scale.bias.val().slice([filters]);
        scale.of(weight, phases, pictures.clone())
    }

    /// Numbers of filters of each scale.
    pub fn counts(&self) -> impl Iterator<Item = usize> {
        self.scales.iter().map(|scale| scale.bias.shape().num_elements())
    }

    /// Features `[batch, embed_dim]` of normalised pictures.
    pub fn forward(&self, pictures: &Tensor<4>) -> Tensor<2> {
        self.proj.forward(self.statistics(pictures))
    }

    /// Filters `[scales][filters][3][kernel][kernel]` and phases `[scales][filters]`.
    pub fn with_filters(mut self, weights: &[f32], phases: &[f32]) -> Self {
        let count = self.scales.len().max(1);
        let weights = weights.chunks_exact(weights.len() / count);
        let phases = phases.chunks_exact(phases.len() / count);
        let fill = |(scale, (weights, phases)): (Scale, (&[f32], &[f32]))| Scale {
            weight: set(scale.weight, weights.to_vec()),
            bias: set(scale.bias, phases.to_vec()),
            size: scale.size,
            surround: scale.surround,
        };
        self.scales = self.scales.into_iter().zip(weights.zip(phases)).map(fill).collect();
        self
    }

    /// The linear head: `matrix` is `[scales * filters][embed_dim]`, `bias` is `[embed_dim]`.
    pub fn with_head(mut self, matrix: Vec<f32>, bias: Vec<f32>) -> Self {
        self.proj.weight = set(self.proj.weight, matrix);
        self.proj.bias = self.proj.bias.map(|b| set(b, bias));
        self
    }
}

impl Scale {
    fn statistics(&self, pictures: Tensor<4>) -> Tensor<2> {
        self.of(self.weight.val(), self.bias.val(), pictures)
    }

    fn of(&self, weight: Tensor<4>, phases: Tensor<1>, pictures: Tensor<4>) -> Tensor<2> {
        let x = match self.size {
            1 => pictures,
            n => avg_pool2d(pictures, AvgPoolOptions::new([n; 2]).with_stride([n; 2])),
        };
        let x = match self.surround {
            1 => x,
            n => {
                let inside = AvgPoolOptions::new([n; 2])
                    .with_stride([1; 2])
                    .with_padding([n / 2; 2])
                    .with_count_include_pad(false);
                x.clone() - avg_pool2d(x, inside)
            }
        };
        let filters = weight.reshape([-1, 3]); // the kernel is one pixel
        mean_sines(x, filters, phases)
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::ClipConfig;
    use super::super::{ClipModel, ImageTower, Parts};
    use super::*;
    use burn::tensor::TensorData;

    const SIZE: usize = 64;

    fn config() -> ClipConfig {
        let mut config = crate::train::config(&crate::train::TrainOptions::default());
        config.vision.image_size = SIZE;
        config.vision.width = 8;
        config.embed_dim = 6;
        config
    }

    fn tower() -> RandomFourierEncoder {
        match ClipModel::init(&config(), Parts::Image, &Device::flex(), 3).visual {
            Some(ImageTower::RandomFourier(tower)) => tower,
            other => panic!("{other:?}"),
        }
    }

    fn picture(value: impl Fn(usize) -> f32) -> Tensor<4> {
        let values: Vec<f32> = (0..3 * SIZE * SIZE).map(value).collect();
        Tensor::from_data(TensorData::new(values, [1, 3, SIZE, SIZE]), &Device::flex())
    }

    fn values(tensor: Tensor<2>) -> Vec<f32> {
        tensor.try_to_vec_as::<f32>().unwrap()
    }

    /// A tower with filters as the shipped model has them.
    fn shipped_filters() -> RandomFourierEncoder {
        let (filters, phases) = crate::train::filters(8 * 3, crate::train::NORM, crate::train::LUMA, 1);
        tower().with_filters(&filters, &phases)
    }

    #[test]
    fn flat_pictures_read_alike_at_every_scale_place_and_size() {
        for level in [-2.0, 0.0, 0.7] {
            let tower = shipped_filters();
            let averages = values(tower.statistics(&picture(|_| level)));
            let small = Tensor::<4>::full([1, 3, 16, 16], level, &Device::flex());
            for (a, b) in averages.iter().zip(values(tower.statistics(&small))) {
                assert!((a - b).abs() < 1e-4, "{a} {b}");
            }
        }
    }

    #[test]
    fn grounds_of_black_and_white_have_no_response() {
        let normalization = config().normalization;
        for level in [0.0, 1.0] {
            let ground = Tensor::<4>::full([1, 3, SIZE, SIZE], level, &Device::flex());
            let input = super::super::preprocess(ground, SIZE, &normalization);
            let response = values(shipped_filters().statistics(&input));
            assert!(response.iter().all(|v| v.abs() < 1e-4), "{level}: {response:?}");
        }
    }

    #[test]
    fn averages_do_not_depend_on_the_place() {
        // The same blob in two places, aligned to the coarsest scale.
        let blob = |x0: usize, y0: usize| {
            picture(move |i| {
                let (x, y) = (i % SIZE, i / SIZE % SIZE);
                let inside = (x0..x0 + 8).contains(&x) && (y0..y0 + 8).contains(&y);
                if inside {
                    ((x - x0) as f32 - 3.5) * 0.2 + (y - y0) as f32 * 0.05
                } else {
                    0.0
                }
            })
        };
        let averages = |at| values(shipped_filters().statistics(&at));
        let (a, b, elsewhere) = (
            averages(blob(24, 28)),
            averages(blob(32, 24)),
            averages(picture(|i| (i as f32).sin())),
        );
        let gap = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(gap(&a, &b) < 1e-4, "{}", gap(&a, &b));
        assert!(gap(&a, &elsewhere) > 1e-2);
    }

    #[test]
    fn configuration_survives_writing() {
        let text = config().to_open_clip().unwrap();
        assert_eq!(ClipConfig::parse("test", &text).unwrap(), config());
        let broken = text.replace("\"kernel\": 1", "\"kernel\": 3");
        assert!(
            ClipConfig::parse("test", &broken)
                .unwrap_err()
                .to_string()
                .contains("kernel")
        );
    }
}
