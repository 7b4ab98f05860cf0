//! The residual attention blocks that both the vision and the text transformer are made of.
use super::config::{Activation, BlockConfig};
use super::layer_norm::LayerNorm;
use super::params::param;
use crate::card::{attend, attends, gelu, layer, layer_onto, linear, on_card};
use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::{sigmoid, softmax};
use burn::tensor::{Device, Tensor};
use std::f64::consts::FRAC_1_SQRT_2;

/// Pre-norm transformer. Fields are named as in OpenCLIP's checkpoints, so that a field's path is its tensor's name.
#[derive(Module, Debug)]
pub struct Transformer {
    resblocks: Vec<Block>,
}

#[derive(Module, Debug)]
struct Block {
    ln_1: LayerNorm,
    attn: Attention,
    ln_2: LayerNorm,
    mlp: Perceptron,
}

#[derive(Module, Debug)]
struct Attention {
    /// Query, key and value side by side, `[width, 3 * width]`.
    in_proj_weight: Param<Tensor<2>>,
    in_proj_bias: Param<Tensor<1>>,
    out_proj: Linear,
    heads: usize,
}

#[derive(Module, Debug)]
struct Perceptron {
    c_fc: Linear,
    c_proj: Linear,
    #[module(skip)]
    activation: Activation,
}

impl Transformer {
    /// Lays out the blocks for tokens of `width`.
    pub fn new(width: usize, config: &BlockConfig, device: &Device) -> Self {
        Self {
            resblocks: (0..config.layers).map(|_| Block::new(width, config, device)).collect(),
        }
    }

    /// `[batch, tokens, width]` to the same shape; with `causal`, a token sees itself and those before it only.
    pub fn forward(&self, tokens: Tensor<3>, causal: bool) -> Tensor<3> {
        let mask = causal.then(|| causal_mask(tokens.dims()[1], &tokens.device()));
        self.resblocks
            .iter()
            .fold(tokens, |x, block| block.forward(x, mask.as_ref()))
    }
}

impl Block {
    fn new(width: usize, config: &BlockConfig, device: &Device) -> Self {
        Self {
            ln_1: layer_norm(width, config, device),
            attn: Attention {
                in_proj_weight: param([width, 3 * width], device),
                in_proj_bias: param([3 * width], device),
                out_proj: LinearConfig::new(width, width).init(device),
                heads: config.heads,
            },
            ln_2: layer_norm(width, config, device),
            mlp: Perceptron {
                c_fc: LinearConfig::new(width, config.mlp_width).init(device),
                c_proj: LinearConfig::new(config.mlp_width, width).init(device),
                activation: config.activation,
            },
        }
    }

    fn forward(&self, x: Tensor<3>, mask: Option<&Tensor<4>>) -> Tensor<3> {
        let attended = self.attn.forward(self.ln_1.forward(x.clone()), mask);
        let x = layer_onto(&self.attn.out_proj, attended, x);
        let hidden = layer(&self.mlp.c_fc, self.ln_2.forward(x.clone()));
        layer_onto(&self.mlp.c_proj, self.mlp.activation.forward(hidden), x)
    }
}

impl Attention {
    /// What tokens take of each other, before the last linear map.
    fn forward(&self, x: Tensor<3>, mask: Option<&Tensor<4>>) -> Tensor<3> {
        let [_, tokens, width] = x.dims();
        let (weight, bias) = (self.in_proj_weight.val(), self.in_proj_bias.val());
        if on_card(&x) && attends(tokens, width / self.heads) {
            let qkv = linear(x, weight, Some(bias));
            return attend(qkv, self.heads, mask.is_some());
        }
        // Slicing the weights rather than the product keeps the gradient to `x` free of zero-padded copies.
        let [q, k, v] = [0, 1, 2].map(|i| {
            let columns = i * width..(i + 1) * width;
            let bias = bias.clone().slice([columns.clone()]);
            linear(x.clone(), weight.clone().slice([0..width, columns]), Some(bias))
        });
        attention(q, k, v, self.heads, mask)
    }
}

/// Multi-head scaled dot-product attention: queries `[b, n, w]`, keys and values `[b, m, w]`, `mask` (added to the
/// scores) `[1, 1, n, m]`; gives `[b, n, w]` with the heads side by side.
pub(crate) fn attention(q: Tensor<3>, k: Tensor<3>, v: Tensor<3>, heads: usize, mask: Option<&Tensor<4>>) -> Tensor<3> {
    let [batch, queries, width] = q.dims();
    let split = |t: Tensor<3>| {
        let tokens = t.dims()[1];
        t.reshape([batch, tokens, heads, width / heads]).swap_dims(1, 2)
    };
    let scale = 1.0 / ((width / heads) as f64).sqrt();
    let scores = split(q.mul_scalar(scale)).matmul(split(k).swap_dims(2, 3));
    let scores = match mask {
        Some(mask) => scores + mask.clone(),
        None => scores,
    };
    softmax(scores, 3)
        .matmul(split(v))
        .swap_dims(1, 2)
        .reshape([batch, queries, width])
}

impl Activation {
    /// The activation of every value.
    pub fn forward<const D: usize>(self, x: Tensor<D>) -> Tensor<D> {
        if on_card(&x) {
            return gelu(x, self == Activation::QuickGelu);
        }
        match self {
            Activation::QuickGelu => x.clone() * sigmoid(x.mul_scalar(1.702)),
            Activation::Gelu => {
                let twice_cdf = x.clone().mul_scalar(FRAC_1_SQRT_2).erf().add_scalar(1.0);
                x.mul_scalar(0.5) * twice_cdf
            }
        }
    }
}

pub(super) fn layer_norm(width: usize, config: &BlockConfig, device: &Device) -> LayerNorm {
    LayerNorm::new(width, config.norm_epsilon, device)
}

/// Zero where a key may be seen, hugely negative (not infinite, which shaders need not support) where it may not.
fn causal_mask(tokens: usize, device: &Device) -> Tensor<4> {
    Tensor::<2>::full([tokens, tokens], -1e9, device).triu(1).unsqueeze()
}
