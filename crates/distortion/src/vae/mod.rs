//! A learned codec: the factorised-prior autoencoder of Ballé et al. 2018 ("Variational image compression with a scale
//! hyperprior", arXiv 1802.01436) as CompressAI publishes it (`bmshj2018_factorized`, quality 3).
//!
//! Its entropy coder is lossless, so what the codec does to a picture is the analysis transform, rounding of the
//! latents, and the synthesis transform.
mod gdn;
#[cfg(test)]
mod tests;
mod weights;

use std::path::Path;

use burn::tensor::module::{conv_transpose2d, conv2d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions, PadMode};
use burn::tensor::{Device, Tensor, TensorData};

use crate::error::{Error, Result};
use crate::rounding::round_straight_through;
use gdn::Gdn;
use weights::{Channels, Stage, Weights};

/// Four stages halve the sides, so pictures are padded to multiples of this.
const UNIT: usize = 16;

/// The codec with its weights on a device.
#[derive(Clone, Debug)]
pub struct Vae {
    analysis: Vec<Layer>,
    synthesis: Vec<Layer>,
    /// Medians of the latents, `[1, m, 1, 1]`.
    medians: Tensor<4>,
}

/// A convolution with kernel 5 and stride 2 and what follows it, if anything does.
#[derive(Clone, Debug)]
struct Layer {
    weight: Tensor<4>,
    bias: Tensor<1>,
    gdn: Option<Gdn>,
}

impl Vae {
    /// Reads the weights from a safetensors file with CompressAI's tensor names (N = 128, M = 192, all of them f32).
    /// Tensors beyond those needed are ignored.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be read, [`Error::BadWeights`] with the tensor's name when one is missing or
    /// has another shape, or when the file is no safetensors file or larger than 64 MiB.
    pub fn load(path: &Path, device: &Device) -> Result<Self> {
        Self::from_bytes(&path.display().to_string(), &weights::read(path)?, device)
    }

    /// As [`Vae::load`] for a file that is in memory; `name` is for error messages.
    ///
    /// # Errors
    /// [`Error::BadWeights`] as there.
    pub fn from_bytes(name: &str, bytes: &[u8], device: &Device) -> Result<Self> {
        Self::with_channels(name, bytes, Channels::PUBLISHED, device)
    }

    fn with_channels(name: &str, bytes: &[u8], channels: Channels, device: &Device) -> Result<Self> {
        let weights = weights::parse(bytes, channels).map_err(|reason| Error::BadWeights {
            name: name.into(),
            reason,
        })?;
        Ok(Self::new(weights, device))
    }

    fn new(weights: Weights, device: &Device) -> Self {
        // The codec is not trained, so its weights need no gradient; they serve pictures with and without one.
        let device = &device.clone().without_autodiff();
        let layers = |stages: Vec<Stage>, inverse| -> Vec<Layer> {
            let layer = |stage: Stage| Layer {
                weight: Tensor::from_data(TensorData::new(stage.weight, stage.shape), device),
                bias: Tensor::from_data(TensorData::new(stage.bias, [stage.outputs]), device),
                gdn: stage.gdn.map(|(beta, gamma)| Gdn::new(beta, gamma, inverse, device)),
            };
            stages.into_iter().map(layer).collect()
        };
        let count = weights.medians.len();
        Self {
            analysis: layers(weights.analysis, false),
            synthesis: layers(weights.synthesis, true),
            medians: Tensor::from_data(TensorData::new(weights.medians, [1, count, 1, 1]), device),
        }
    }

    /// What is left of pictures `[b, 3, h, w]` in [0, 1] after they were compressed; differentiable in them (rounding
    /// has the gradient of the identity), clamped to [0, 1]. Sides that are no multiple of 16 are padded with the last
    /// row and column, and the result is cut back.
    pub fn reconstruct(&self, pictures: Tensor<4>) -> Tensor<4> {
        let [b, c, h, w] = pictures.dims();
        if b == 0 || h == 0 || w == 0 {
            return pictures;
        }
        let [height, width] = [h, w].map(|side| side.next_multiple_of(UNIT));
        let mut x = pictures;
        if [height, width] != [h, w] {
            x = x.pad([(0, height - h), (0, width - w)], PadMode::Edge);
        }
        let latents = self.analyse(x);
        let rounded = round_straight_through(latents - self.medians.clone()) + self.medians.clone();
        self.synthesise(rounded).slice([0..b, 0..c, 0..h, 0..w]).clamp(0.0, 1.0)
    }

    /// `[b, 3, h, w]` to latents `[b, m, h / 16, w / 16]`.
    fn analyse(&self, x: Tensor<4>) -> Tensor<4> {
        self.analysis.iter().fold(x, |x, layer| {
            let options = ConvOptions::new([2, 2], [2, 2], [1, 1], 1);
            layer.normalise(conv2d(x, layer.weight.clone(), Some(layer.bias.clone()), options))
        })
    }

    /// The way back.
    fn synthesise(&self, y: Tensor<4>) -> Tensor<4> {
        self.synthesis.iter().fold(y, |y, layer| {
            // One more row and column, so that sides double.
            let options = ConvTransposeOptions::new([2, 2], [2, 2], [1, 1], [1, 1], 1);
            layer.normalise(conv_transpose2d(
                y,
                layer.weight.clone(),
                Some(layer.bias.clone()),
                options,
            ))
        })
    }
}

impl Layer {
    fn normalise(&self, x: Tensor<4>) -> Tensor<4> {
        match &self.gdn {
            Some(gdn) => gdn.forward(x),
            None => x,
        }
    }
}
