//! The encoder that the decoder is trained against: it adds a residual of a given strength to pictures.
use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::module::{avg_pool2d, conv2d};
use burn::tensor::ops::{AvgPoolOptions, ConvOptions};
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::parameter::{draw, parameter};

/// Channels of the pattern that a message becomes.
const PATTERN: usize = 12;
/// Side of a tile of the pattern, at half the picture's size.
const TILE: usize = 16;
/// Channels between the two convolutions.
const HIDDEN: usize = 32;

/// Turns a message into a pattern of tiles, and pattern and picture into a residual.
///
/// HiDDeN (Zhu et al. 2018, arXiv 1807.09937) repeats the bits at every pixel. Then a smooth picture leaves nothing to
/// make a texture of; tiles that are learned give one, and a decoder learns to read them in far fewer steps.
/// It works at half the picture's size, so that the residual holds no detail that a small change of scale would wipe out.
#[derive(Module, Debug)]
pub(crate) struct Encoder {
    tiles: Param<Tensor<2>>,
    pilot: Param<Tensor<2>>,
    first: Param<Tensor<4>>,
    first_bias: Param<Tensor<1>>,
    second: Param<Tensor<4>>,
}

impl Encoder {
    /// An untrained encoder of messages of `bits` bits.
    pub fn new(bits: usize, rng: &mut impl Rng, device: &Device) -> Self {
        let area = PATTERN * TILE * TILE;
        let inputs = PATTERN + 3;
        let bound = |fan_in: usize| (6.0 / fan_in as f32).sqrt();
        Self {
            tiles: parameter(
                &draw(rng, bits * area, (3.0 / bits as f32).sqrt()),
                [bits, area],
                device,
            ),
            pilot: parameter(&draw(rng, area, 1.0), [1, area], device),
            first: parameter(
                &draw(rng, HIDDEN * inputs * 9, bound(inputs * 9)),
                [HIDDEN, inputs, 3, 3],
                device,
            ),
            first_bias: parameter(&[0.0; HIDDEN], [HIDDEN], device),
            second: parameter(&draw(rng, 3 * HIDDEN * 9, bound(HIDDEN * 9)), [3, HIDDEN, 3, 3], device),
        }
    }

    /// Pictures `[b, 3, h, w]` in [0, 1] with even sides that carry messages `[b, bits]` of 0 and 1: each gets a
    /// residual whose root mean square is `strength` before the sum is clamped to [0, 1].
    pub fn forward(&self, pictures: Tensor<4>, messages: Tensor<2>, strength: f32) -> Tensor<4> {
        let residual = self.residual(pictures.clone(), messages);
        let [b, c, h, w] = residual.dims();
        let square: Tensor<2> = residual.clone().square().reshape([b, c * h * w]).mean_dim(1);
        let scale = (square + 1e-12).sqrt().recip() * strength;
        (pictures + residual * scale.reshape([b, 1, 1, 1])).clamp(0.0, 1.0)
    }

    fn residual(&self, pictures: Tensor<4>, messages: Tensor<2>) -> Tensor<4> {
        let half = avg_pool2d(pictures, AvgPoolOptions::new([2, 2]));
        let [b, _, h, w] = half.dims();
        let signs = messages * 2.0 - 1.0;
        let tile = (signs.matmul(self.tiles.val()) + self.pilot.val()).reshape([b, PATTERN, TILE, TILE]);
        let pattern = tile.repeat(&[1, 1, h.div_ceil(TILE), w.div_ceil(TILE)]);
        let pattern = pattern.slice([0..b, 0..PATTERN, 0..h, 0..w]);
        let options = || ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
        let x = Tensor::cat(vec![half, pattern], 1);
        let x = relu(conv2d(x, self.first.val(), Some(self.first_bias.val()), options()));
        let x = conv2d(x, self.second.val(), None, options());
        let x: Tensor<6> = x.reshape([b, 3, h, 1, w, 1]);
        let x: Tensor<4> = x.repeat(&[1, 1, 1, 2, 1, 2]).reshape([b, 3, 2 * h, 2 * w]);
        let smooth = AvgPoolOptions {
            padding: [(1, 1), (1, 1)],
            stride: [1, 1],
            ..AvgPoolOptions::new([3, 3])
        };
        avg_pool2d(x, smooth)
    }
}
