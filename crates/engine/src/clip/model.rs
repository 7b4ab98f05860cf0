//! Both towers as one trainable burn module.
use super::config::{ClipConfig, VisionTower};
use super::params::param;
use super::random_fourier::{Layout, RandomFourierEncoder};
use super::resnet::ResNet;
use super::text::TextTransformer;
use super::vit::VisionTransformer;
use crate::card::{on_card, unit_rows};
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

/// Added to the squared length of a feature, so that none is divided by 0.
const TINY: f32 = 1e-24;

/// Which towers a model has: text features are only needed for keys, image features only for scenes and pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parts {
    /// The image tower only.
    Image,
    /// The text tower only.
    Text,
    /// Both.
    Both,
}

/// The towers. Made by [`ClipModel::new`], then loaded ([`super::weights`]) or initialised ([`super::init`]).
#[derive(Module, Debug)]
pub struct ClipModel {
    /// The image tower, when it was asked for.
    pub visual: Option<ImageTower>,
    /// The text tower, when it was asked for.
    pub text: Option<TextTransformer>,
    /// Logarithm of the factor on cosine similarities in contrastive training, `[1]`.
    pub logit_scale: Param<Tensor<1>>,
}

/// The image tower, of whichever kind.
#[allow(clippy::large_enum_variant)] // a model has one
#[derive(Module, Debug)]
pub enum ImageTower {
    /// Vision transformer.
    Transformer(VisionTransformer),
    /// Modified ResNet.
    ResNet(ResNet),
    /// Local statistics.
    RandomFourier(RandomFourierEncoder),
}

impl ClipModel {
    /// Lays out the model; its parameters take no memory until they are loaded or initialised.
    pub fn new(config: &ClipConfig, parts: Parts, device: &Device) -> Self {
        let visual = (parts != Parts::Text).then(|| ImageTower::new(config, device));
        let text = (parts != Parts::Image).then(|| TextTransformer::new(&config.text, config.embed_dim, device));
        Self {
            visual,
            text,
            logit_scale: param([1], device),
        }
    }
}

impl ClipModel {
    /// Frozen, and made ready for use with the weights that it has.
    pub fn settled(self) -> Self {
        let mut model = self.freeze();
        model.visual = model.visual.map(|tower| match tower {
            ImageTower::RandomFourier(tower) => ImageTower::RandomFourier(tower.settled()),
            other => other,
        });
        model
    }
}

impl ImageTower {
    fn new(config: &ClipConfig, device: &Device) -> Self {
        let (vision, embed_dim) = (&config.vision, config.embed_dim);
        match &vision.tower {
            VisionTower::Transformer { patch_size, blocks } => {
                Self::Transformer(VisionTransformer::new(vision, *patch_size, blocks, embed_dim, device))
            }
            VisionTower::ResNet { layers, heads } => {
                Self::ResNet(ResNet::new(vision, *layers, *heads, embed_dim, device))
            }
            VisionTower::Statistics {
                scales,
                kernel,
                surround,
                tones: _,
                equalization,
            } => {
                let layout = Layout {
                    scales,
                    kernel: *kernel,
                    surround: *surround,
                    equalization: *equalization,
                };
                Self::RandomFourier(RandomFourierEncoder::new(vision, layout, embed_dim, device))
            }
        }
    }

    /// Features `[batch, embed_dim]`, not normalised, of pictures `[batch, 3, image_size, image_size]` from
    /// which mean and deviation were removed.
    pub fn forward(&self, pictures: Tensor<4>) -> Tensor<2> {
        match self {
            Self::Transformer(tower) => tower.forward(pictures),
            Self::ResNet(tower) => tower.forward(pictures),
            Self::RandomFourier(tower) => tower.forward(&pictures),
        }
    }
}

/// Rows divided by their Euclidean length, `[n, d]`. A zero row stays zero, with a finite gradient.
pub fn normalize(features: Tensor<2>) -> Tensor<2> {
    if on_card(&features) {
        return unit_rows(features, TINY);
    }
    let squares = features.clone().square().sum_dim(1);
    features / squares.add_scalar(TINY).sqrt()
}
