//! What was done to the tones of a picture, all of it together: a point of a space that can be searched.
use std::fmt;

use super::curve;
use super::tone::{GREY, grey};
use crate::picture::Picture;
use crate::simd::{Instructions, Vectorised};

/// Coordinates of a [`ToneChange`].
pub(in crate::extract) const COORDINATES: usize = 10;
/// Values this near to black or white were cut there by what was done, and say nothing of what they had been.
const CUT: f32 = 0.5 / 255.0;
/// How far beyond black and white a change may have put values: what compression does besides.
const BEYOND: f32 = 0.03;
/// What black may have become at least and at most.
const MOST_FADED: [f32; 2] = [-0.5, 0.5];
/// Share of a picture's values that may be farther out.
const OUTSIDE: f32 = 0.02;

/// Gains of the channels, a gamma, a fade of each channel, a curve, a saturation and a contrast, done one after the other.
/// Undone, the last goes first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::extract) struct ToneChange {
    /// Logarithms of the gains of red, green and blue, of gamma, of saturation and of contrast; the [bend](curve) of a curve;
    /// and what black became in a fade of each channel, below 0 where levels were stretched to it. 0 is nothing done.
    pub coordinates: [f32; COORDINATES],
}

impl ToneChange {
    /// Place of the logarithm of gamma.
    const GAMMA: usize = 3;
    /// Place of the logarithm of contrast.
    const CONTRAST: usize = 5;
    /// Place of the bend of a curve.
    const BEND: usize = 6;
    /// First place of what black became.
    const FADES: usize = 7;

    /// This one, moved by `distance` along a direction.
    pub fn moved(&self, direction: &[f32; COORDINATES], distance: f32) -> Self {
        let mut coordinates = self.coordinates;
        coordinates
            .iter_mut()
            .zip(direction)
            .for_each(|(v, d)| *v += distance * d);
        Self { coordinates }
    }

    /// What black became in each channel.
    fn fades(&self) -> [f32; 3] {
        let [.., red, green, blue] = self.coordinates;
        [red, green, blue]
    }

    /// Whether black became another colour.
    pub fn is_fade(&self) -> bool {
        self.fades() != [0.0; 3]
    }

    /// A colour laid over the picture, so thick that `share` of it hides what was there, as a ground tells it that had been
    /// white; `None` where no such colour can have made it that.
    pub fn overlay(ground: [f32; 3], share: f32) -> Option<Self> {
        let mut change = Self::default();
        for (c, level) in ground.into_iter().enumerate() {
            let black = level - (1.0 - share);
            if !(0.0..=share).contains(&black) {
                return None;
            }
            change.coordinates[Self::FADES + c] = black;
            change.coordinates[c] = ((1.0 - share) / (1.0 - black)).ln();
        }
        Some(change)
    }

    /// The mean grey that a picture had before its contrast was changed, which did not move it. Where contrast grew,
    /// values at black and white had been there before: a ground, most of all.
    fn mean_before(&self, picture: &Picture) -> f32 {
        let contrast = self.coordinates[Self::CONTRAST].exp();
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
        let mean = match self.coordinates[Self::CONTRAST] {
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

    /// A colour of a part of `whole` before this was done to it, not cut.
    pub fn colour_before(&self, colour: [f32; 3], whole: &Picture) -> [f32; 3] {
        let mean = match self.coordinates[Self::CONTRAST] {
            0.0 => 0.0,
            _ => self.mean_before(whole),
        };
        Before::new(self, mean).of(colour)
    }

    /// This one with the gains under which that colour of a ground had been white.
    pub fn with_white(&self, ground: [f32; 3], whole: &Picture) -> Self {
        let mut change = *self;
        change.coordinates[..3].fill(0.0);
        let before = change.colour_before(ground, whole);
        for (log, value) in change.coordinates.iter_mut().zip(before) {
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
    /// The bend, and what black became in each channel, where there was a curve or a fade.
    shape: Option<(f32, [f32; 3])>,
    /// One over gamma, where that was changed.
    exponent: Option<f32>,
    gains: [f32; 3],
}

impl Before {
    /// Of a picture with this mean grey before its contrast was changed.
    fn new(change: &ToneChange, mean: f32) -> Self {
        let [red, green, blue, gamma, saturation, contrast, ..] = change.coordinates.map(f32::exp);
        let bend = change.coordinates[ToneChange::BEND];
        let fades = change.fades();
        let [least, most] = MOST_FADED;
        Self {
            mean,
            contrast,
            saturation,
            shape: (bend != 0.0 || fades != [0.0; 3])
                .then(|| (curve::limited(bend), fades.map(|black| black.clamp(least, most)))),
            exponent: (change.coordinates[ToneChange::GAMMA] != 0.0).then_some(1.0 / gamma),
            gains: [red, green, blue],
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
        if let Some((bend, blacks)) = self.shape {
            for (v, black) in pixel.iter_mut().zip(blacks) {
                *v = (curve::before(*v, bend) - black) / (1.0 - black);
            }
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
        // Apart, so that loops without powers have no calls, and those without a curve no iterations.
        let without_power = Before {
            exponent: None,
            ..before
        };
        let plain = Before {
            shape: None,
            ..without_power
        };
        match (before.exponent, before.shape) {
            (None, None) => self.each(plain),
            (None, Some(_)) => self.each(without_power),
            (Some(_), _) => self.each(before),
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
        let [red, green, blue, gamma, saturation, contrast, ..] = self.coordinates.map(f32::exp);
        let bend = self.coordinates[Self::BEND];
        let fades = self.fades();
        let fade: f32 = GREY.iter().zip(fades).map(|(w, v)| w * v).sum();
        let brightness: f32 = GREY.iter().zip([red, green, blue]).map(|(w, v)| w * v).sum();
        let told = [
            ("brightness x", brightness, 1.0),
            ("red x", red / brightness, 1.0),
            ("green x", green / brightness, 1.0),
            ("blue x", blue / brightness, 1.0),
            ("gamma", gamma, 1.0),
            ("saturation x", saturation, 1.0),
            ("contrast x", contrast, 1.0),
            ("black at", fade, 0.0),
            ("curve bent by", bend, 0.0),
        ];
        let told = told
            .into_iter()
            .filter(|(_, value, none)| (value - none).abs() >= 0.005);
        let told: Vec<String> = told.map(|(name, value, _)| format!("{name} {value:.2}")).collect();
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
    fn each_factor_is_undone_as_it_was_done() {
        let before = picture((0..60).map(|i| 0.3 + 0.3 * (i as f32 * 0.37).sin().abs()).collect());
        for place in 0..ToneChange::BEND {
            for log in [-0.2, 0.2] {
                let change = |log: f32| {
                    let mut change = ToneChange::default();
                    change.coordinates[place] = log;
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
    fn fades_and_curves_are_undone() {
        let before = picture((0..90).map(|i| 0.2 + 0.008 * i as f32).collect());
        let sine = |v: &f32| (std::f32::consts::TAU * v).sin() / std::f32::consts::TAU;
        for (place, amount, done) in [
            (
                ToneChange::FADES,
                0.2,
                &(|v: &f32| 0.2 + 0.8 * v) as &dyn Fn(&f32) -> f32,
            ),
            (ToneChange::FADES, -0.1, &|v: &f32| -0.1 + 1.1 * v),
            (ToneChange::BEND, 0.6, &|v: &f32| v - 0.6 * sine(v)),
            (ToneChange::BEND, -0.4, &|v: &f32| v + 0.4 * sine(v)),
        ] {
            let mut change = ToneChange::default();
            let last = if place == ToneChange::FADES {
                COORDINATES
            } else {
                place + 1
            };
            change.coordinates[place..last].fill(amount);
            let done = picture(before.pixels.iter().map(done).collect());
            let after = change.undone(&done, &done).unwrap();
            for (a, b) in after.pixels.iter().zip(&before.pixels) {
                assert!((a - b).abs() < 0.002, "{place} {amount}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_ground_tells_the_colour_that_was_laid_over_it() {
        let before = picture((0..90).map(|i| 0.01 * i as f32).collect());
        let over = [0.8, 0.85, 1.0];
        let laid = |(i, v): (usize, &f32)| 0.85 * v + 0.15 * over[i % 3];
        let done = picture(before.pixels.iter().enumerate().map(laid).collect());
        let ground = over.map(|v| 0.85 + 0.15 * v);
        let after = ToneChange::overlay(ground, 0.15).unwrap().undone(&done, &done).unwrap();
        for (a, b) in after.pixels.iter().zip(&before.pixels) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
        assert_eq!(ToneChange::overlay([0.6, 1.0, 1.0], 0.2), None);
    }

    #[test]
    fn contrast_is_undone_about_the_mean_from_before_a_ground_was_cut() {
        let scene = (0..30).map(|i| 0.3 + 0.01 * i as f32);
        let before = picture(scene.chain(std::iter::repeat_n(1.0, 60)).collect());
        let mean = before.pixels.iter().sum::<f32>() / before.pixels.len() as f32;
        let more = |v: &f32| (mean + 1.2 * (v - mean)).clamp(0.0, 1.0);
        let done = picture(before.pixels.iter().map(more).collect());
        let mut change = ToneChange::default();
        change.coordinates[ToneChange::CONTRAST] = 1.2_f32.ln();
        let after = change.undone(&done, &done).unwrap();
        for (a, b) in after.pixels.iter().zip(&before.pixels[..30]) {
            assert!((a - b).abs() < 0.003, "{a} {b}");
        }
    }

    #[test]
    fn what_cannot_have_been_done_is_told() {
        let dim = picture(vec![0.9; 30]);
        let mut change = ToneChange::default();
        change.coordinates[..3].fill(-0.4);
        assert_eq!(change.undone(&dim, &dim), None);
        // White that was cut says nothing.
        let white = picture(vec![1.0; 30]);
        assert_eq!(change.undone(&white, &white), Some(white.clone()));
        let fitted = change.with_white([0.9, 0.8, 1.0], &dim);
        let gains = fitted.coordinates.map(f32::exp);
        assert!((gains[0] - 0.9).abs() < 1e-6 && (gains[1] - 0.8).abs() < 1e-6 && gains[2] == 1.0);
    }

    #[test]
    fn changes_are_told_in_words() {
        let logs = [0.8_f32, 0.8, 0.88, 1.0, 1.2, 1.0].map(f32::ln);
        let mut change = ToneChange::default();
        change.coordinates[..6].copy_from_slice(&logs);
        change.coordinates[ToneChange::FADES..].fill(0.1);
        let told = "brightness x 0.81, red x 0.99, green x 0.99, blue x 1.09, saturation x 1.20, black at 0.10 undone";
        assert_eq!(change.to_string(), told);
        assert_eq!(ToneChange::default().to_string(), "tones as they are");
    }
}
