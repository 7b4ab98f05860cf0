//! The mean grey about which a picture's contrast was changed.
use super::tone::grey;
use super::undo::CUT;
use crate::picture::Picture;
use crate::simd::{Instructions, Vectorised};

/// The mean grey that a picture had before its contrast was changed by a factor, which did not move it. Where contrast grew,
/// values at black and white had been there before: a ground, most of all.
pub(super) fn mean_before(picture: &Picture, contrast: f32) -> f32 {
    let pixels = picture.pixels.as_chunks().0;
    let instructions = Instructions::widest();
    let mean = |centre: Option<f32>| {
        instructions.run(MeanGrey {
            pixels,
            contrast,
            centre,
        })
    };
    let first = mean(None);
    let rounds = if contrast > 1.0 { 3 } else { 0 };
    (0..rounds).fold(first, |centre, _| mean(Some(centre)))
}

/// The mean grey of pixels whose contrast about a centre is undone first, unless they are black or white; without a centre
/// as they are.
struct MeanGrey<'a> {
    pixels: &'a [[f32; 3]],
    contrast: f32,
    centre: Option<f32>,
}

/// Pixels whose greys are added up side by side.
const LANES: usize = 16;

impl Vectorised for MeanGrey<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> f32 {
        let sum = match self.centre {
            None => self.sum(|v| v),
            Some(centre) => self.sum(|v| match v <= CUT || v >= 1.0 - CUT {
                true => v,
                false => centre + (v - centre) / self.contrast,
            }),
        };
        (sum / self.pixels.len().max(1) as f64) as f32
    }
}

impl MeanGrey<'_> {
    #[inline(always)]
    fn sum(&self, value: impl Fn(f32) -> f32) -> f64 {
        let mut lanes = [0.0_f64; LANES];
        let (blocks, rest) = self.pixels.as_chunks::<LANES>();
        for block in blocks {
            for (lane, [red, green, blue]) in lanes.iter_mut().zip(block) {
                *lane += f64::from(grey(&[value(*red), value(*green), value(*blue)]));
            }
        }
        for (lane, [red, green, blue]) in lanes.iter_mut().zip(rest) {
            *lane += f64::from(grey(&[value(*red), value(*green), value(*blue)]));
        }
        lanes.iter().sum()
    }
}
