//! JPEG as a differentiable function: what an encoder and a decoder do to a picture, with a gradient.
//!
//! Colours are turned to YCbCr as JFIF has them, chroma is halved if asked for, blocks of 8 x 8 are transformed and
//! divided by the table, rounded with the gradient of the identity, and all of it is undone. What is left out is that
//! codecs hold halved chroma and decoded values in 8 bits and approximate the transform.
mod blocks;
mod tables;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::{AvgPoolOptions, PadMode};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::groups::{Group, assemble, take};
use crate::matrices::{Lines, resample};
use crate::rounding::round_straight_through;

/// Resolution of the chroma channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Chroma {
    /// Half along both axes, as most encoders do unless asked for more.
    #[default]
    #[serde(rename = "4:2:0")]
    Half,
    /// Whole.
    #[serde(rename = "4:4:4")]
    Full,
}

/// How one picture is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jpeg {
    /// libjpeg's quality, within 1 and 100.
    pub quality: u8,
    /// Resolution of the chroma channels.
    pub chroma: Chroma,
    /// With a seed, uniform noise within half a step is added to coefficients instead of rounding them; its gradient is
    /// exact.
    pub noise: Option<u64>,
}

/// Compresses pictures `[b, 3, h, w]` in [0, 1], each in its own way; the result is clamped to [0, 1].
pub(crate) fn jpeg(pictures: Tensor<4>, each: &[Jpeg]) -> Tensor<4> {
    let mut alike: BTreeMap<(Chroma, bool), Vec<usize>> = BTreeMap::new();
    for (i, one) in each.iter().enumerate() {
        alike.entry((one.chroma, one.noise.is_some())).or_default().push(i);
    }
    let groups = alike.into_iter().map(|((chroma, _), positions)| -> Group {
        let chosen: Vec<_> = positions.iter().filter_map(|&i| each.get(i)).collect();
        let whole = compress(take(&pictures, &positions), &chosen, chroma);
        (positions, whole)
    });
    assemble(groups.collect()).unwrap_or(pictures)
}

/// Compresses pictures with one resolution of chroma, all rounded or all with noise.
fn compress(pictures: Tensor<4>, each: &[&Jpeg], chroma: Chroma) -> Tensor<4> {
    let [b, _, h, w] = pictures.dims();
    let device = pictures.device();
    // An encoder repeats the last row and column up to whole units, before it halves chroma.
    let unit = match chroma {
        Chroma::Half => 2 * blocks::SIDE,
        Chroma::Full => blocks::SIDE,
    };
    let [height, width] = [h, w].map(|side| side.next_multiple_of(unit));
    let mut x = pictures * 255.0;
    if [height, width] != [h, w] {
        x = x.pad([(0, height - h), (0, width - w)], PadMode::Edge);
    }
    let flat = x.reshape([b, 3, height * width]);
    let mut x = to_ycbcr(&device).matmul(flat).reshape([b, 3, height, width]);
    if each.iter().all(|one| one.noise.is_none()) {
        // Encoders hold these in 8 bits; at coarse steps it decides to which side much is rounded.
        x = round_straight_through(x);
    }
    // Chroma is around 0 already, because the 128 of JFIF and the level shift of the transform cancel.
    let luma = x.clone().slice([0..b, 0..1]) - 128.0;
    let mut colour = x.slice([0..b, 1..3]);
    if chroma == Chroma::Half {
        colour = avg_pool2d(colour, AvgPoolOptions::new([2, 2]).with_stride([2, 2]));
    }
    let transform = blocks::dct(&device);
    let [luma, mut colour] = [(luma, 0), (colour, 1)].map(|(plane, table)| {
        let dims = plane.dims();
        let steps: Vec<f32> = each.iter().flat_map(|one| tables::tables(one.quality)[table]).collect();
        let steps = Tensor::<3>::from_data(TensorData::new(steps, [b, 1, blocks::AREA]), &device);
        let coefficients = blocks::split(plane).matmul(transform.clone()) / steps.clone();
        let quantised = match uniform(each, table as u64, coefficients.dims(), &device) {
            Some(noise) => coefficients + noise,
            None => round_straight_through(coefficients),
        };
        let pixels = (quantised * steps).matmul(transform.clone().swap_dims(1, 2));
        blocks::join(pixels, dims)
    });
    if chroma == Chroma::Half {
        // libjpeg's "fancy upsampling": 3/4 of the nearer sample and 1/4 of the next, which is bilinear resizing.
        let [height, width] = [h, w].map(|side| side.div_ceil(2));
        colour = colour.slice([0..b, 0..2, 0..height, 0..width]);
        let double = |side| [Lines::resize(side, 2 * side)];
        colour = resample(colour, &double(height), &double(width));
    }
    let luma = luma.slice([0..b, 0..1, 0..h, 0..w]) + 128.0;
    let colour = colour.slice([0..b, 0..2, 0..h, 0..w]);
    let flat = Tensor::cat(vec![luma, colour], 1).reshape([b, 3, h * w]);
    let x = from_ycbcr(&device).matmul(flat).reshape([b, 3, h, w]);
    (x / 255.0).clamp(0.0, 1.0)
}

/// Noise within half a step, `[b, blocks, 64]`, if it is asked for; drawn on the host, the same on every device.
fn uniform(each: &[&Jpeg], plane: u64, dims: [usize; 3], device: &Device) -> Option<Tensor<3>> {
    let seeds: Option<Vec<u64>> = each.iter().map(|one| one.noise).collect();
    let mut values = Vec::with_capacity(dims.iter().product());
    for seed in seeds? {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(plane);
        values.extend((0..dims[1] * dims[2]).map(|_| rng.random::<f32>() - 0.5));
    }
    Some(Tensor::from_data(TensorData::new(values, dims), device))
}

/// JFIF 1.02: Y, Cb - 128 and Cr - 128 of R, G and B, `[1, 3, 3]`.
fn to_ycbcr(device: &Device) -> Tensor<3> {
    Tensor::from_data(
        [[
            [0.299_f32, 0.587, 0.114],
            [-0.168_735_89, -0.331_264_1, 0.5],
            [0.5, -0.418_687_6, -0.081_312_41],
        ]],
        device,
    )
}

/// JFIF 1.02: R, G and B of Y, Cb - 128 and Cr - 128, `[1, 3, 3]`.
fn from_ycbcr(device: &Device) -> Tensor<3> {
    Tensor::from_data(
        [[
            [1.0_f32, 0.0, 1.402],
            [1.0, -0.344_136_3, -0.714_136_3],
            [1.0, 1.772, 0.0],
        ]],
        device,
    )
}
