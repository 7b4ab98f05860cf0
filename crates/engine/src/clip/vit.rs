//! CLIP's vision transformer (Dosovitskiy et al. 2021, with CLIP's extra normalisation before the blocks).
use super::config::{BlockConfig, VisionConfig};
use super::layer_norm::LayerNorm;
use super::params::param;
use super::transformer::{Transformer, layer_norm};
use crate::card::linear;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

/// Image tower of the transformer kind. Fields are named as in OpenCLIP's checkpoints.
#[derive(Module, Debug)]
pub struct VisionTransformer {
    conv1: PatchEmbedding,
    class_embedding: Param<Tensor<1>>,
    positional_embedding: Param<Tensor<2>>,
    ln_pre: LayerNorm,
    transformer: Transformer,
    ln_post: LayerNorm,
    proj: Param<Tensor<2>>,
}

/// A convolution whose stride is its kernel's size: a linear map of each patch.
#[derive(Module, Debug)]
struct PatchEmbedding {
    /// `[width, 3, patch, patch]`
    weight: Param<Tensor<4>>,
}

impl VisionTransformer {
    /// Lays out the tower; `embed_dim` is the width of its features.
    pub fn new(
        vision: &VisionConfig,
        patch_size: usize,
        blocks: &BlockConfig,
        embed_dim: usize,
        device: &Device,
    ) -> Self {
        let (width, patches) = (vision.width, (vision.image_size / patch_size).pow(2));
        Self {
            conv1: PatchEmbedding {
                weight: param([width, 3, patch_size, patch_size], device),
            },
            class_embedding: param([width], device),
            positional_embedding: param([patches + 1, width], device),
            ln_pre: layer_norm(width, blocks, device),
            transformer: Transformer::new(width, blocks, device),
            ln_post: layer_norm(width, blocks, device),
            proj: param([width, embed_dim], device),
        }
    }

    /// Features `[batch, embed_dim]` of normalised pictures `[batch, 3, image_size, image_size]`.
    pub fn forward(&self, pictures: Tensor<4>) -> Tensor<2> {
        let patches = self.conv1.forward(pictures);
        let [batch, _, width] = patches.dims();
        let class = self
            .class_embedding
            .val()
            .reshape([1, 1, width])
            .expand([batch, 1, width]);
        let tokens = Tensor::cat(vec![class, patches], 1) + self.positional_embedding.val().unsqueeze();
        let tokens = self.transformer.forward(self.ln_pre.forward(tokens), false);
        let class = tokens.slice([0..batch, 0..1]).reshape([batch, width]);
        linear(self.ln_post.forward(class), self.proj.val(), None)
    }
}

impl PatchEmbedding {
    /// `[b, 3, h, w]` to `[b, patches, width]`, patches row by row.
    fn forward(&self, pictures: Tensor<4>) -> Tensor<3> {
        let weight = self.weight.val();
        let [width, channels, patch, _] = weight.dims();
        let [batch, _, h, w] = pictures.dims();
        let (rows, columns) = (h / patch, w / patch);
        let patches = pictures
            .reshape([batch, channels, rows, patch, columns, patch])
            .permute([0, 2, 4, 1, 3, 5])
            .reshape([batch, rows * columns, channels * patch * patch]);
        linear(
            patches,
            weight.reshape([width, channels * patch * patch]).transpose(),
            None,
        )
    }
}
