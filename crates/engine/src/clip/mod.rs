//! CLIP in burn: both published kinds of image tower and one of our own, the text tower, and weights from published checkpoints.
//!
//! [`Clip`] is a loaded, frozen model whose features are differentiable in the pictures. [`ClipModel`] is the
//! trainable module inside, for the project's own small CLIP.
pub mod config;
mod conv;
mod init;
mod layer_norm;
mod model;
mod names;
mod params;
mod preprocess;
mod random_fourier;
mod resnet;
mod shipped;
mod sines;
mod tensor_file;
mod text;
mod transformer;
mod vit;
mod weighted_colours;
mod weights;

pub use config::ClipConfig;
pub use model::{ClipModel, ImageTower, Parts, normalize};
pub use preprocess::{normalized, preprocess};
pub use random_fourier::RandomFourierEncoder;
pub use resnet::ResNet;
pub use shipped::ShippedClip;
pub use tensor_file::{TensorFile, TensorSource};
pub use text::TextTransformer;
pub use transformer::Transformer;
#[cfg(test)]
pub(crate) use transformer::attention;
pub use vit::VisionTransformer;
pub use weighted_colours::WeightedColours;
pub use weights::Precision;

pub(crate) use tensor_file::{check_header, hash};
pub(crate) use weights::write_whole;

use crate::error::{Error, Result};
use crate::resize::resize;
use burn::module::Module;
use burn::tensor::{Device, Int, Tensor};
use std::path::{Path, PathBuf};

/// A loaded CLIP with frozen weights.
#[derive(Debug)]
pub struct Clip {
    /// Its sizes.
    pub config: ClipConfig,
    /// SHA-256 of the weights file, in hexadecimal: what keys are bound to.
    pub hash: String,
    model: ClipModel,
}

impl Clip {
    /// Numbers of the towers that are loaded.
    pub fn parameters(&self) -> usize {
        self.model.num_params()
    }

    /// Loads `config.json` and `model.safetensors` (or `open_clip_config.json` and `open_clip_model.safetensors`)
    /// from a folder.
    ///
    /// # Errors
    /// [`Error::BadModel`] when configuration and weights do not fit each other or are damaged, [`Error::Io`] when
    /// they cannot be read.
    pub fn load(dir: &Path, device: &Device, parts: Parts) -> Result<Self> {
        let config = ClipConfig::read(dir)?;
        let mut file = TensorFile::open(&weights_path(dir)?)?;
        let model = ClipModel::new(&config, parts, device).load(&mut file)?;
        Ok(Self {
            config,
            hash: file.sha256()?,
            model: model.settled(),
        })
    }

    /// The newest of the project's own small CLIPs ([`ShippedClip`]).
    ///
    /// # Errors
    /// As [`Clip::load`].
    pub fn shipped(device: &Device, parts: Parts) -> Result<Self> {
        let [newest, ..] = ShippedClip::ALL;
        newest.load(device, parts)
    }

    /// A frozen model from its parts, for one that was just trained or that has no file.
    pub fn from_model(config: ClipConfig, hash: String, model: ClipModel) -> Self {
        Self {
            config,
            hash,
            model: model.settled(),
        }
    }

    /// Width of the features.
    pub fn dim(&self) -> usize {
        self.config.embed_dim
    }

    /// The towers.
    pub fn model(&self) -> &ClipModel {
        &self.model
    }

    /// L2-normalised features `[b, dim]` of pictures `[b, 3, h, w]` with values in [0, 1], of any size: they are
    /// resized (antialiased bilinear, aspect squashed) and normalised first. Differentiable in the pictures.
    ///
    /// # Panics
    /// When the model was loaded without its image tower.
    pub fn image_features(&self, pictures: Tensor<4>) -> Tensor<2> {
        let side = self.config.vision.image_size;
        self.features_as_they_are(resize(pictures, side, side))
    }

    /// [`Clip::image_features`] of pictures that are not resized. Only a tower that averages over pixels takes other sizes than
    /// its own.
    ///
    /// # Panics
    /// When the model was loaded without its image tower.
    pub fn features_as_they_are(&self, pictures: Tensor<4>) -> Tensor<2> {
        let tower = self
            .model
            .visual
            .as_ref()
            .expect("loaded with Parts::Image or Parts::Both");
        normalize(tower.forward(normalized(pictures, &self.config.normalization)))
    }

    /// [`Clip::features_as_they_are`] of pictures of which each has these colours, a histogram for each of the tower's scales;
    /// `None` where the tower looks at more than how often colours are there.
    pub fn features_of_colours(&self, pictures: &[Vec<WeightedColours>]) -> Option<Tensor<2>> {
        match self.model.visual.as_ref()? {
            ImageTower::RandomFourier(tower) => tower
                .forward_colours(pictures, &self.config.normalization)
                .map(normalize),
            _ => None,
        }
    }

    /// L2-normalised features `[b, dim]` of token ids `[b, n]`, each below `vocab_size`, `n` at most the context
    /// length. What follows the end token is without influence and may be cut off.
    ///
    /// # Panics
    /// When the model was loaded without its text tower.
    pub fn text_features(&self, tokens: Tensor<2, Int>) -> Tensor<2> {
        let tower = self
            .model
            .text
            .as_ref()
            .expect("loaded with Parts::Text or Parts::Both");
        normalize(tower.forward(tokens))
    }
}

/// The weights file in `dir`.
pub(crate) fn weights_path(dir: &Path) -> Result<PathBuf> {
    let found = ["model.safetensors", "open_clip_model.safetensors"].map(|name| dir.join(name));
    found
        .into_iter()
        .find(|path| path.is_file())
        .ok_or_else(|| Error::BadModel {
            name: dir.display().to_string(),
            reason: "has no model.safetensors (one file; sharded and pickled weights are not read)".into(),
        })
}

#[cfg(test)]
mod tests;
