//! What was done to the tones of a picture, all of it together: a point of a space that can be searched.
use std::fmt;

use super::tone::{GREY, grey};
use crate::picture::Picture;
use crate::simd::{Instructions, Vectorised};

/// Coordinates of a [`ToneChange`].
pub(in crate::extract) const COORDINATES: usize = 6;
/// Values this near to black or white were cut there by what was done, and say nothing of what they had been.
const CUT: f32 = 0.5 / 255.0;
/// How far beyond black and white a change may have put values: what compression does besides.
const BEYOND: f32 = 0.03;
/// Share of a picture's values that may be farther out.
const OUTSIDE: f32 = 0.02;

/// Gains of the channels, a gamma, a saturation and a contrast, done one after the other. Undone, the last goes first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::extract) struct ToneChange {
    /// Logarithms of the gains of red, green and blue, of gamma, of saturation and of contrast; 0 is nothing done.
    pub logs: [f32; COORDINATES],
}

impl ToneChange {
    /// Place of the logarithm of gamma.
    const GAMMA: usize = 3;
    /// Place of the logarithm of contrast.
    const CONTRAST: usize = 5;

    /// This one, moved by `distance` along a direction.
    pub fn moved(&self, direction: &[f32; COORDINATES], distance: f32) -> Self {
        let mut logs = self.logs;
        logs.iter_mut().zip(direction).for_each(|(v, d)| *v += distance * d);
        Self { logs }
    }

    /// The mean grey that a picture had before its contrast was changed, which did not move it. Where contrast grew,
    /// values at black and white had been there before: a ground, most of all.
    fn mean_before(&self, picture: &Picture) -> f32 {
        let contrast = self.logs[Self::CONTRAST].exp();
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

    /// The picture before this was done to it, values cut to [0, 1]; `None` where that can't be: what was done can only
    /// have been done to values in [0, 1], and many would lie outside. Its contrast was changed about the mean of
    /// `whole`, of which it is a part.
    pub fn undone(&self, picture: &Picture, whole: &Picture) -> Option<Picture> {
        let mean = match self.logs[Self::CONTRAST] {
            0.0 => 0.0,
            _ => self.mean_before(whole),
        };
        let mut pixels = vec![0.0; picture.pixels.len()];
        let outside = Instructions::widest().run(Undo {
            before: Before::new(self, mean),
            pixels: picture.pixels.as_chunks().0,
            out: pixels.as_chunks_mut().0,
        });
        let possible = outside as f32 <= OUTSIDE * pixels.len() as f32;
        possible.then_some(Picture { pixels, ..*picture })
    }

    /// This one with the gains under which that colour of a ground had been white.
    pub fn with_white(&self, ground: [f32; 3], whole: &Picture) -> Self {
        let mut change = *self;
        change.logs[..3].fill(0.0);
        let before = Before::new(&change, change.mean_before(whole)).of(ground);
        for (log, value) in change.logs.iter_mut().zip(before) {
            *log = value.clamp(0.1, 2.0).ln();
        }
        change
    }
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

/// What undoes a change, worked out once for all pixels.
#[derive(Clone, Copy)]
struct Before {
    mean: f32,
    contrast: f32,
    saturation: f32,
    /// One over gamma, where that was changed.
    exponent: Option<f32>,
    gains: [f32; 3],
}

impl Before {
    /// Of a picture with this mean grey before its contrast was changed.
    fn new(change: &ToneChange, mean: f32) -> Self {
        let [gains @ .., gamma, saturation, contrast] = change.logs.map(f32::exp);
        Self {
            mean,
            contrast,
            saturation,
            exponent: (change.logs[ToneChange::GAMMA] != 0.0).then_some(1.0 / gamma),
            gains,
        }
    }

    /// Values before the change was done to them, not cut; what was cut when it was done stays cut.
    #[inline(always)]
    fn of(&self, now: [f32; 3]) -> [f32; 3] {
        let mut pixel = now;
        for v in &mut pixel {
            *v = self.mean + (*v - self.mean) / self.contrast;
        }
        let grey = grey(&pixel);
        for v in &mut pixel {
            *v = grey + (*v - grey) / self.saturation;
        }
        if let Some(exponent) = self.exponent {
            for v in &mut pixel {
                *v = v.max(0.0).powf(exponent);
            }
        }
        for (v, gain) in pixel.iter_mut().zip(self.gains) {
            *v /= gain;
        }
        pixel
    }
}

/// Undoes a change, and counts values that it can't have been done to.
struct Undo<'a> {
    before: Before,
    pixels: &'a [[f32; 3]],
    out: &'a mut [[f32; 3]],
}

impl Vectorised for Undo<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> usize {
        let before = self.before;
        // Apart, so that the loop without powers has no calls.
        let plain = Before {
            exponent: None,
            ..before
        };
        match before.exponent {
            None => self.each(plain),
            Some(_) => self.each(before),
        }
    }
}

impl Undo<'_> {
    #[inline(always)]
    fn each(self, before: Before) -> usize {
        let mut outside = 0_u32;
        for (out, now) in self.out.iter_mut().zip(self.pixels) {
            let was = before.of(*now);
            for c in 0..3 {
                let seen = (now[c] > CUT) & (now[c] < 1.0 - CUT);
                let possible = (was[c] >= -BEYOND) & (was[c] <= 1.0 + BEYOND);
                outside += u32::from(seen & !possible);
                out[c] = was[c].clamp(0.0, 1.0);
            }
        }
        outside as usize
    }
}

/// In words, with every part that is not 1.
impl fmt::Display for ToneChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [red, green, blue, gamma, saturation, contrast] = self.logs.map(f32::exp);
        let brightness: f32 = GREY.iter().zip([red, green, blue]).map(|(w, v)| w * v).sum();
        let told = [
            ("brightness x", brightness),
            ("red x", red / brightness),
            ("green x", green / brightness),
            ("blue x", blue / brightness),
            ("gamma", gamma),
            ("saturation x", saturation),
            ("contrast x", contrast),
        ];
        let told = told.into_iter().filter(|(_, factor)| (factor - 1.0).abs() >= 0.005);
        let told: Vec<String> = told.map(|(name, factor)| format!("{name} {factor:.2}")).collect();
        match told.is_empty() {
            true => f.write_str("tones as they are"),
            false => write!(f, "{} undone", told.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(pixels: Vec<f32>) -> Picture {
        Picture {
            width: (pixels.len() / 3) as u32,
            height: 1,
            pixels,
        }
    }

    #[test]
    fn each_coordinate_is_undone_as_it_was_done() {
        let before = picture((0..60).map(|i| 0.3 + 0.3 * (i as f32 * 0.37).sin().abs()).collect());
        for place in 0..COORDINATES {
            for log in [-0.2, 0.2] {
                let change = |log: f32| {
                    let mut change = ToneChange::default();
                    change.logs[place] = log;
                    change
                };
                let done = change(-log).undone(&before, &before).unwrap();
                assert_ne!(done, before);
                let after = change(log).undone(&done, &done).unwrap();
                for (a, b) in after.pixels.iter().zip(&before.pixels) {
                    assert!((a - b).abs() < 1e-5, "{place} {log}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn contrast_is_undone_about_the_mean_from_before_a_ground_was_cut() {
        let scene = (0..30).map(|i| 0.3 + 0.01 * i as f32);
        let before = picture(scene.chain(std::iter::repeat_n(1.0, 60)).collect());
        let mean = before.pixels.iter().sum::<f32>() / before.pixels.len() as f32;
        let more = |v: &f32| (mean + 1.2 * (v - mean)).clamp(0.0, 1.0);
        let done = picture(before.pixels.iter().map(more).collect());
        let mut change = ToneChange::default();
        change.logs[ToneChange::CONTRAST] = 1.2_f32.ln();
        let after = change.undone(&done, &done).unwrap();
        for (a, b) in after.pixels.iter().zip(&before.pixels[..30]) {
            assert!((a - b).abs() < 0.003, "{a} {b}");
        }
    }

    #[test]
    fn what_cannot_have_been_done_is_told() {
        let dim = picture(vec![0.9; 30]);
        let mut change = ToneChange::default();
        change.logs[..3].fill(-0.4);
        assert_eq!(change.undone(&dim, &dim), None);
        // White that was cut says nothing.
        let white = picture(vec![1.0; 30]);
        assert_eq!(change.undone(&white, &white), Some(white.clone()));
        let fitted = change.with_white([0.9, 0.8, 1.0], &dim);
        let gains = fitted.logs.map(f32::exp);
        assert!((gains[0] - 0.9).abs() < 1e-6 && (gains[1] - 0.8).abs() < 1e-6 && gains[2] == 1.0);
    }

    #[test]
    fn changes_are_told_in_words() {
        let change = ToneChange {
            logs: [0.8_f32, 0.8, 0.88, 1.0, 1.2, 1.0].map(f32::ln),
        };
        let told = "brightness x 0.81, red x 0.99, green x 0.99, blue x 1.09, saturation x 1.20 undone";
        assert_eq!(change.to_string(), told);
        assert_eq!(ToneChange::default().to_string(), "tones as they are");
    }
}
