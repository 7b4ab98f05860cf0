//! One distortion for each picture of a batch, drawn at random.
use std::collections::BTreeMap;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::blur::blur;
use crate::brightness::brightness;
use crate::combined::combined;
use crate::contrast::contrast;
use crate::crop::crop;
use crate::draw::Draw;
use crate::error::{Error, Result};
use crate::groups::{Group, assemble, take};
use crate::jpeg::jpeg;
use crate::kind::DistortionKind;
use crate::mask::mask;
use crate::noise::noise;
use crate::ranges::Ranges;
use crate::robust_to::RobustTo;
use crate::rotation::rotation;
use crate::rounding::eight_bit;
use crate::scaling::scaling;

/// Which distortions pictures may get, and how strong they are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Layer {
    /// The distortions, of which those that act on the scene are left to others.
    pub robust_to: RobustTo,
    /// From what ranges they are drawn.
    pub ranges: Ranges,
}

impl Layer {
    /// Fails with [`Error::OutOfRange`] or [`Error::Reversed`] unless all ranges are in order and within their limits.
    /// To be called before the others: what they do outside of the limits is undefined, though they do not panic.
    pub fn check(&self) -> Result<()> {
        self.ranges.check()
    }

    /// What `count` pictures get: each one of clean and the chosen distortions, all equally likely. Takes two numbers
    /// for each picture from `rng`, whatever is chosen and whatever the ranges are.
    pub fn draw(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Draw> {
        let kinds: Vec<_> = self.robust_to.of_pictures().collect();
        (0..count).map(|_| Draw::random(&kinds, &self.ranges, rng)).collect()
    }

    /// Distorts pictures `[b, 3, h, w]` in [0, 1], each in its own way; differentiable in them. The result has their
    /// shape and their order, and is in [0, 1] again, up to rounding. Rotated pictures show `background` in the corners.
    pub fn apply(&self, pictures: Tensor<4>, background: [f32; 3], rng: &mut ChaCha8Rng) -> Tensor<4> {
        let draws = self.draw(pictures.dims()[0], rng);
        distort(&draws, pictures, background)
    }

    /// As [`Layer::apply`] with draws that are known, for example from [`Layer::draw`]; what was chosen and the ranges
    /// do not matter.
    ///
    /// # Errors
    /// [`Error::WrongDraws`] unless there is one draw for each picture, [`Error::BadShape`] unless there are pixels in
    /// three channels, [`Error::OutOfRange`] when a draw has a number outside its limits.
    pub fn apply_with(&self, draws: &[Draw], pictures: Tensor<4>, background: [f32; 3]) -> Result<Tensor<4>> {
        let shape @ [count, channels, h, w] = pictures.dims();
        if channels != 3 || h == 0 || w == 0 {
            return Err(Error::BadShape { shape });
        }
        if draws.len() != count {
            return Err(Error::WrongDraws {
                draws: draws.len(),
                pictures: count,
            });
        }
        draws.iter().try_for_each(Draw::check)?;
        Ok(distort(draws, pictures, background))
    }
}

/// Distorts pictures of one kind together and puts them back in order.
fn distort(draws: &[Draw], pictures: Tensor<4>, background: [f32; 3]) -> Tensor<4> {
    let [_, _, h, w] = pictures.dims();
    let mut alike: BTreeMap<Option<DistortionKind>, Vec<usize>> = BTreeMap::new();
    for (i, draw) in draws.iter().enumerate() {
        alike.entry(draw.kind()).or_default().push(i);
    }
    let nothing_to_do = alike.keys().all(Option::is_none);
    if nothing_to_do || h == 0 || w == 0 {
        return pictures;
    }
    let groups = alike.into_iter().map(|(kind, positions)| -> Group {
        let chosen: Vec<_> = positions.iter().filter_map(|&i| draws.get(i)).collect();
        let some = take(&pictures, &positions);
        let done = match kind {
            Some(kind) => alike_distorted(kind, &chosen, some, background),
            None => some,
        };
        (positions, done)
    });
    assemble(groups.collect()).unwrap_or(pictures)
}

/// Applies draws of one kind to their pictures.
fn alike_distorted(kind: DistortionKind, draws: &[&Draw], pictures: Tensor<4>, background: [f32; 3]) -> Tensor<4> {
    macro_rules! each {
        ($variant:ident) => {
            &draws
                .iter()
                .filter_map(|draw| match draw {
                    Draw::$variant(what) => Some(what.clone()),
                    _ => None,
                })
                .collect::<Vec<_>>()
        };
    }
    match kind {
        DistortionKind::Crop => crop(pictures, each!(Crop)),
        DistortionKind::Scaling => scaling(pictures, each!(Scaling)),
        DistortionKind::Rotation => rotation(pictures, each!(Rotation), background),
        DistortionKind::Brightness => brightness(pictures, each!(Brightness)),
        DistortionKind::Contrast => contrast(pictures, each!(Contrast)),
        DistortionKind::Jpeg => jpeg(pictures, each!(Jpeg)),
        DistortionKind::Noise => noise(pictures, each!(Noise)),
        DistortionKind::Blur => blur(pictures, each!(Blur)),
        DistortionKind::Mask => mask(pictures, each!(Mask)),
        DistortionKind::EightBit => eight_bit(pictures),
        DistortionKind::Combined => combined(pictures, each!(Combined)),
        DistortionKind::ShNoise
        | DistortionKind::ShTruncation
        | DistortionKind::Spz
        | DistortionKind::Sog
        | DistortionKind::Pruning => pictures,
    }
}
