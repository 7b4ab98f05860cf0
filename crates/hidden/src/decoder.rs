//! The convolutional decoder on a device: pictures to one logit a bit.
use burn::module::{Module, Param};
use burn::nn::{GroupNorm, GroupNormConfig};
use burn::tensor::activation::relu;
use burn::tensor::module::{avg_pool2d, conv2d};
use burn::tensor::ops::{AvgPoolOptions, ConvOptions};
use burn::tensor::{Device, Tensor};

use crate::error::{Result, host};
use crate::parameter::parameter;
use crate::weights::{BLOCKS, Block, CHANNELS, DILATIONS, FEATURES, KERNEL, STRIDES, Weights};

/// Groups of channels that are normalised together (Wu and He 2018, arXiv 1803.08494).
const GROUPS: usize = 8;
/// Side of the box whose mean is taken from each pixel; it leaves details up to about twice that size.
const BOX: usize = 9;
/// By how much details are amplified before they are limited: a mark of 36 dB has then a root mean square of 0.13.
const GAIN: f32 = 8.0;

/// The decoder; it can be trained when its device tracks gradients.
#[derive(Module, Debug)]
pub(crate) struct Decoder {
    blocks: Vec<Layer>,
    head: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

/// Convolution, group normalisation and ReLU.
#[derive(Module, Debug)]
struct Layer {
    kernel: Param<Tensor<4>>,
    norm: GroupNorm,
    stride: usize,
    dilation: usize,
}

impl Decoder {
    /// Puts weights on a device; their sizes must have been checked.
    pub fn new(weights: &Weights, device: &Device) -> Self {
        let layer = |(i, block): (usize, &Block)| {
            let (inputs, outputs) = (CHANNELS[i], CHANNELS[i + 1]);
            let mut norm = GroupNormConfig::new(GROUPS, outputs).init(device);
            norm.gamma = Some(parameter(&block.gain, [outputs], device));
            norm.beta = Some(parameter(&block.shift, [outputs], device));
            Layer {
                kernel: parameter(&block.kernel, [outputs, inputs, KERNEL, KERNEL], device),
                norm,
                stride: STRIDES[i],
                dilation: DILATIONS[i],
            }
        };
        Self {
            blocks: weights.blocks.iter().enumerate().map(layer).collect(),
            head: parameter(&weights.head, [FEATURES, weights.bits], device),
            bias: parameter(&weights.bias, [weights.bits], device),
        }
    }

    /// Copies the weights back to the host.
    pub fn weights(&self) -> Result<Weights> {
        let mut blocks = Vec::with_capacity(BLOCKS);
        for layer in &self.blocks {
            let vector = |param: &Option<Param<Tensor<1>>>| param.as_ref().map_or(Ok(Vec::new()), |p| host(p.val()));
            blocks.push(Block {
                kernel: host(layer.kernel.val())?,
                gain: vector(&layer.norm.gamma)?,
                shift: vector(&layer.norm.beta)?,
            });
        }
        let empty = || Block {
            kernel: Vec::new(),
            gain: Vec::new(),
            shift: Vec::new(),
        };
        let mut blocks = blocks.into_iter();
        let weights = Weights {
            bits: self.bias.dims()[0],
            blocks: std::array::from_fn(|_| blocks.next().unwrap_or_else(empty)),
            head: host(self.head.val())?,
            bias: host(self.bias.val())?,
        };
        weights.check("decoder")?;
        Ok(weights)
    }

    /// Logits `[b, bits]` of pictures `[b, 3, h, w]`.
    pub fn forward(&self, pictures: Tensor<4>) -> Tensor<2> {
        let mut x = details(pictures);
        for layer in &self.blocks {
            let options = ConvOptions::new([layer.stride; 2], [layer.dilation; 2], [layer.dilation; 2], 1);
            x = relu(layer.norm.forward(conv2d(x, layer.kernel.val(), None, options)));
        }
        let [b, c, h, w] = x.dims();
        let means: Tensor<2> = x.reshape([b, c, h * w]).mean_dim(2).reshape([b, c]);
        means.matmul(self.head.val()) + self.bias.val().unsqueeze()
    }
}

/// What pictures have beyond the mean of their surroundings, amplified and limited to +-1. Edges of what is shown are
/// far stronger than a mark; limited, they cannot drown it.
fn details(pictures: Tensor<4>) -> Tensor<4> {
    let along = |kernel_size: [usize; 2]| AvgPoolOptions {
        padding: kernel_size.map(|side| (side / 2, side / 2)),
        stride: [1, 1],
        count_include_pad: false,
        ..AvgPoolOptions::new(kernel_size)
    };
    let rows = avg_pool2d(pictures.clone(), along([BOX, 1]));
    let mean = avg_pool2d(rows, along([1, BOX]));
    let x = (pictures - mean) * GAIN;
    x.clone() / (x.square() + 1.0).sqrt()
}
