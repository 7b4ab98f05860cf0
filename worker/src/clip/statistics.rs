//! Image tower of local statistics: what a picture's texture is, wherever it stands in the picture.
//!
//! The picture at several scales passes a layer of small filters, a soft saturation and a rectifier; each response is
//! averaged over the whole picture and divided by the mean response of its scale, so that brightness drops out. A
//! linear head turns the averages into the feature. Because every filter is small and every response is averaged, a
//! change of texture moves the feature alike in every view; deep towers without long training do not have that.
use super::config::VisionConfig;
use super::params::param;
use super::weights::set;
use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::{relu, tanh};
use burn::tensor::module::{avg_pool2d, conv2d};
use burn::tensor::ops::{AvgPoolOptions, ConvOptions};
use burn::tensor::{Device, Tensor};

/// Added to a scale's mean response before dividing by it: a flat picture has no response at all.
const FLAT: f32 = 1e-2;

/// Image tower of the statistics kind.
#[derive(Module, Debug)]
pub struct StatisticsTower {
    scales: Vec<Scale>,
    proj: Linear,
}

/// The filters of one scale.
#[derive(Module, Debug)]
struct Scale {
    /// `[filters, 3, kernel, kernel]`.
    weight: Param<Tensor<4>>,
    /// `[filters]`, added after the saturation.
    bias: Param<Tensor<1>>,
    /// Side of the square that is averaged into one pixel of this scale.
    size: usize,
}

impl StatisticsTower {
    /// Lays out the tower; `embed_dim` is the width of its features.
    pub fn new(vision: &VisionConfig, scales: &[usize], kernel: usize, embed_dim: usize, device: &Device) -> Self {
        let filters = vision.width;
        let scale = |&size: &usize| Scale {
            weight: param([filters, 3, kernel, kernel], device),
            bias: param([filters], device),
            size,
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

    /// Features `[batch, embed_dim]` of normalised pictures.
    pub fn forward(&self, pictures: &Tensor<4>) -> Tensor<2> {
        self.proj.forward(self.statistics(pictures))
    }

    /// The same filters on every scale: `weights` is `[filters][3][kernel][kernel]`, `biases` is `[filters]`.
    pub fn with_filters(mut self, weights: &[f32], biases: &[f32]) -> Self {
        let fill = |scale: Scale| Scale {
            weight: set(scale.weight, weights.to_vec()),
            bias: set(scale.bias, biases.to_vec()),
            size: scale.size,
        };
        self.scales = self.scales.into_iter().map(fill).collect();
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
        let x = match self.size {
            1 => pictures,
            n => avg_pool2d(pictures, AvgPoolOptions::new([n; 2]).with_stride([n; 2])),
        };
        let x = conv2d(x, self.weight.val(), None, ConvOptions::new([1; 2], [0; 2], [1; 2], 1));
        let [batch, filters, h, w] = x.dims();
        let x = relu(tanh(x) + self.bias.val().reshape([1, filters, 1, 1]));
        let mean = x.reshape([batch, filters, h * w]).mean_dim(2).reshape([batch, filters]);
        let level = mean.clone().mean_dim(1).add_scalar(FLAT);
        mean / level
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::{ClipConfig, VisionTower};
    use super::super::{ClipModel, ImageTower, Parts};
    use super::*;
    use burn::tensor::TensorData;

    fn config() -> ClipConfig {
        let mut config = crate::train::config();
        config.vision.image_size = 24;
        config.vision.width = 8;
        config.embed_dim = 6;
        config
    }

    fn tower() -> StatisticsTower {
        match ClipModel::init(&config(), Parts::Image, &Device::flex(), 3).visual {
            Some(ImageTower::Statistics(tower)) => tower,
            other => panic!("{other:?}"),
        }
    }

    fn picture(value: impl Fn(usize) -> f32) -> Tensor<4> {
        let values: Vec<f32> = (0..3 * 24 * 24).map(value).collect();
        Tensor::from_data(TensorData::new(values, [1, 3, 24, 24]), &Device::flex())
    }

    fn values(tensor: Tensor<2>) -> Vec<f32> {
        tensor.try_to_vec_as::<f32>().unwrap()
    }

    #[test]
    fn flat_pictures_have_finite_features() {
        for level in [-2.0, 0.0, 2.0] {
            assert!(
                values(tower().forward(&picture(|_| level)))
                    .iter()
                    .all(|v| v.is_finite())
            );
        }
    }

    #[test]
    fn averages_do_not_depend_on_the_place() {
        // The same blob in two places, away from the border and aligned to the coarsest scale.
        let blob = |x0: usize, y0: usize| {
            picture(move |i| {
                let (x, y) = (i % 24, i / 24 % 24);
                let inside = (x0..x0 + 4).contains(&x) && (y0..y0 + 4).contains(&y);
                if inside {
                    ((x - x0) as f32 - 1.5) * 0.4 + (y - y0) as f32 * 0.1
                } else {
                    0.0
                }
            })
        };
        let averages = |at| {
            let VisionTower::Statistics { scales, .. } = config().vision.tower else {
                panic!()
            };
            assert_eq!(scales, [1, 2, 4]);
            values(tower().statistics(&at))
        };
        let (a, b, elsewhere) = (
            averages(blob(8, 8)),
            averages(blob(12, 8)),
            averages(picture(|i| (i as f32).sin())),
        );
        // The coarsest scale has 6 x 6 pixels, which a kernel of 5 does not cover alike.
        let gap = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(gap(&a[..16], &b[..16]) < 1e-4, "{}", gap(&a[..16], &b[..16]));
        assert!(gap(&a[..16], &elsewhere[..16]) > 1e-2);
    }

    #[test]
    fn configuration_survives_writing() {
        let text = config().to_open_clip().unwrap();
        assert_eq!(ClipConfig::parse("test", &text).unwrap(), config());
        let broken = text.replace("\"kernel\": 5", "\"kernel\": 25");
        assert!(
            ClipConfig::parse("test", &broken)
                .unwrap_err()
                .to_string()
                .contains("scale")
        );
    }
}
