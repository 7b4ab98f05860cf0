//! Random Fourier feature encoder: which colours a picture has, at several scales, wherever they stand in it.
//!
//! The picture at several scales passes a layer of filters of one pixel; the response y of filter i becomes
//! sin(y + phase_i) and is averaged over the whole picture, and a linear head turns the averages into the feature. The
//! averages are random Fourier features (Rahimi and Recht 2007) of the distribution of colours, its characteristic
//! function at random frequencies. The frequencies are so high that natural colours turn the sine many times: the
//! average over many pixels then varies little from view to view, while a small change of a surface's colour moves it
//! alike from wherever it is seen. (Quantisation index modulation, Chen and Wornell 2001, rejects the interference of
//! its host in the same way.) The sine is a whole number of half turns at black and at white, so that a ground of
//! either adds nothing, and a feature's direction does not depend on how much of the picture a scene fills.
use super::config::{Normalization, VisionConfig};
use super::params::param;
use super::sines::{HostWaves, mean_sines};
use super::weighted_colours::WeightedColours;
use super::weights::set;
use crate::card;
use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;
use std::ops::Range;

/// Image tower of averaged random Fourier features; configurations call it `statistics`.
#[derive(Module, Debug)]
pub struct RandomFourierEncoder {
    scales: Vec<Scale>,
    proj: Linear,
    /// Of a tower whose weights stay as they are, so that they need not be put together at every use.
    #[module(skip)]
    waves: Option<Waves>,
    /// The same on the host.
    #[module(skip)]
    on_host: Option<HostWaves>,
}

/// Filters `[scales * filters, 3]` and phases `[scales * filters]` of all scales.
#[derive(Clone, Debug)]
struct Waves {
    filters: Tensor<2>,
    phases: Tensor<1>,
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
    /// What the density of a pixel's colour counts against it.
    equalization: f32,
}

/// How the filters look at a picture.
#[derive(Clone, Copy, Debug)]
pub struct Layout<'a> {
    /// Sides of the squares that are averaged into one pixel.
    pub scales: &'a [usize],
    /// Side of a filter.
    pub kernel: usize,
    /// Side of the square whose mean is subtracted from a pixel, 1 for nothing.
    pub surround: usize,
    /// What the density of a pixel's colour counts against it, 0 to 1.
    pub equalization: f32,
}

impl RandomFourierEncoder {
    /// Lays out the tower; `embed_dim` is the width of its features.
    pub fn new(vision: &VisionConfig, layout: Layout, embed_dim: usize, device: &Device) -> Self {
        let filters = vision.width;
        let scale = |&size: &usize| Scale {
            weight: param([filters, 3, layout.kernel, layout.kernel], device),
            bias: param([filters], device),
            size,
            surround: layout.surround,
            equalization: layout.equalization,
        };
        Self {
            scales: layout.scales.iter().map(scale).collect(),
            proj: LinearConfig::new(filters * layout.scales.len(), embed_dim).init(device),
            waves: None,
            on_host: None,
        }
    }

    /// Makes it ready for use with the weights that it has, which stay.
    pub fn settled(mut self) -> Self {
        let waves = self.gathered();
        let on_host = |values: TensorData| values.try_into_vec::<f32>().unwrap_or_default();
        let [filters, phases] = [waves.filters.to_data(), waves.phases.to_data()].map(on_host);
        self.on_host = Some(HostWaves::new(&filters, &phases));
        self.waves = Some(waves);
        self
    }

    fn gathered(&self) -> Waves {
        let filters = self.scales.iter().map(|scale| scale.weight.val().reshape([-1, 3])); // the kernel is one pixel
        let phases = self.scales.iter().map(|scale| scale.bias.val());
        Waves {
            filters: Tensor::cat(filters.collect(), 0),
            phases: Tensor::cat(phases.collect(), 0),
        }
    }

    /// Average responses `[batch, scales * filters]` of normalised pictures `[batch, 3, h, w]`.
    pub fn statistics(&self, pictures: &Tensor<4>) -> Tensor<2> {
        let alike = |scale: &Scale| scale.surround == 1 && scale.equalization == self.scales[0].equalization;
        if !self.scales.iter().all(alike) {
            let of_scale = |scale: &Scale| scale.statistics(pictures.clone());
            return Tensor::cat(self.scales.iter().map(of_scale).collect(), 1);
        }
        let Waves { filters, phases } = self.waves.clone().unwrap_or_else(|| self.gathered());
        let sides = self.scales.iter().map(|scale| scale.size).collect();
        mean_sines(pictures.clone(), filters, phases, sides, self.scales[0].equalization)
    }

    /// Average responses `[batch, filters.len()]` of some filters of one scale.
    pub fn statistics_of(&self, scale: usize, filters: Range<usize>, pictures: &Tensor<4>) -> Tensor<2> {
        let scale = &self.scales[scale];
        let weight = scale.weight.val().slice([filters.clone()]);
        let phases = scale.bias.val().slice([filters]);
        scale.of(weight, phases, pictures.clone())
    }

    /// Features `[pictures.len(), embed_dim]` of pictures of which each has these colours at each scale, as
    /// [`RandomFourierEncoder::forward`] has them of pictures. Of a tower that is [settled](Self::settled) and subtracts no
    /// surroundings.
    pub fn forward_colours(
        &self,
        pictures: &[Vec<WeightedColours>],
        normalization: &Normalization,
    ) -> Option<Tensor<2>> {
        let waves = self.on_host.as_ref()?;
        let of_picture = |scales: &Vec<WeightedColours>| {
            let scales: Vec<_> = scales
                .iter()
                .map(|scale| (scale.normalized(normalization), scale.counts.as_slice()))
                .collect();
            waves.means(&scales, self.scales[0].equalization)
        };
        let means: Vec<Vec<f32>> = pictures.par_iter().map(of_picture).collect();
        let shape = [pictures.len(), means.first().map_or(0, Vec::len)];
        let means = TensorData::new(means.concat(), shape);
        Some(card::layer(
            &self.proj,
            Tensor::from_data(means, &self.proj.weight.device()),
        ))
    }

    /// Numbers of filters of each scale.
    pub fn counts(&self) -> impl Iterator<Item = usize> {
        self.scales.iter().map(|scale| scale.bias.shape().num_elements())
    }

    /// Features `[batch, embed_dim]` of normalised pictures.
    pub fn forward(&self, pictures: &Tensor<4>) -> Tensor<2> {
        card::layer(&self.proj, self.statistics(pictures))
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
            equalization: scale.equalization,
        };
        self.scales = self.scales.into_iter().zip(weights.zip(phases)).map(fill).collect();
        (self.waves, self.on_host) = (None, None);
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
        let filters = weight.reshape([-1, 3]); // the kernel is one pixel
        let n = self.surround;
        if n == 1 {
            return mean_sines(pictures, filters, phases, vec![self.size], self.equalization);
        }
        let x = match self.size {
            1 => pictures,
            n => avg_pool2d(pictures, AvgPoolOptions::new([n; 2]).with_stride([n; 2])),
        };
        let inside = AvgPoolOptions::new([n; 2])
            .with_stride([1; 2])
            .with_padding([n / 2; 2])
            .with_count_include_pad(false);
        let apart = x.clone() - avg_pool2d(x, inside);
        mean_sines(apart, filters, phases, vec![1], self.equalization)
    }
}
