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
