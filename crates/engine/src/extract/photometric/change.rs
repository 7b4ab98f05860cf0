//! What was done to the tones of a picture, all of it together: a point of a space that can be searched.
use std::fmt;

use guardsplat_codeword::Tone;

use super::contrast;
use super::tone::GREY;
use super::undo::{Before, Undo};
use crate::picture::Picture;
use crate::simd::Instructions;

/// Coordinates of a [`ToneChange`].
pub(in crate::extract) const COORDINATES: usize = 10;
/// Share of a picture's values that may lie beyond what a change can have been done to.
const OUTSIDE: f32 = 0.02;

/// Gains of the channels, a gamma, a fade of each channel, a curve, a saturation and a contrast, done one after the other.
/// Undone, the last goes first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::extract) struct ToneChange {
    /// How much of each was done, 0 for nothing; the constants say which has which place.
    pub coordinates: [f32; COORDINATES],
}

impl ToneChange {
    /// Places of the logarithms of the gains of red, green and blue.
    pub const GAINS: [usize; 3] = [0, 1, 2];
    /// Place of the logarithm of gamma.
    pub const GAMMA: usize = 3;
    /// Place of the logarithm of saturation.
    pub const SATURATION: usize = 4;
    /// Place of the logarithm of contrast.
    pub const CONTRAST: usize = 5;
    /// Place of the bend of a [curve](super::curve).
    pub const BEND: usize = 6;
    /// Places of what black became in red, green and blue; below 0 where levels were stretched to black.
    pub const FADES: [usize; 3] = [7, 8, 9];

    /// The channels multiplied, by the exponentials of these.
    pub fn of_gains(logs: [f32; 3]) -> Self {
        let mut change = Self::default();
        change.coordinates[..3].copy_from_slice(&logs);
        change
    }

    /// A single tone, of all channels alike.
    pub fn of_tone(tone: Tone) -> Self {
        let (place, factor) = match tone {
            Tone::Brightness(factor) => return Self::of_gains([factor.ln(); 3]),
            Tone::Gamma(exponent) => (Self::GAMMA, exponent),
            Tone::Contrast(factor) => (Self::CONTRAST, factor),
            Tone::Saturation(factor) => (Self::SATURATION, factor),
        };
        let mut change = Self::default();
        change.coordinates[place] = factor.ln();
        change
    }

    /// A curve, and a fade of all channels alike.
    pub fn of_shape(bend: f32, black: f32) -> Self {
        let mut change = Self::default();
        change.coordinates[Self::BEND] = bend;
        for place in Self::FADES {
            change.coordinates[place] = black;
        }
        change
    }

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
    pub fn fades(&self) -> [f32; 3] {
        Self::FADES.map(|place| self.coordinates[place])
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
            change.coordinates[Self::FADES[c]] = black;
            change.coordinates[Self::GAINS[c]] = ((1.0 - share) / (1.0 - black)).ln();
        }
        Some(change)
    }

    /// The picture before this was done to it, values cut to [0, 1]; `None` where that can't be: what was done can only
    /// have been done to values in [0, 1], and many would lie outside. Its contrast was changed about the mean of
    /// `whole`, of which it is a part.
    pub fn undone(&self, picture: &Picture, whole: &Picture) -> Option<Picture> {
        let (before, outside) = self.undone_with_outside(picture, whole);
        (outside as f32 <= OUTSIDE * picture.pixels.len() as f32).then_some(before)
    }

    /// The same of a whole picture, whether or not that can be.
    pub fn undone_at_any_rate(&self, picture: &Picture) -> Picture {
        self.undone_with_outside(picture, picture).0
    }

    /// The picture before, and how many of its values would lie outside.
    fn undone_with_outside(&self, picture: &Picture, whole: &Picture) -> (Picture, usize) {
        let mut pixels = vec![0.0; picture.pixels.len()];
        let outside = Instructions::widest().run(Undo {
            before: self.before(whole),
            pixels: picture.pixels.as_chunks().0,
            out: pixels.as_chunks_mut().0,
        });
        (Picture { pixels, ..*picture }, outside)
    }

    /// What undoes it in a part of `whole`.
    fn before(&self, whole: &Picture) -> Before {
        let mean = match self.coordinates[Self::CONTRAST] {
            0.0 => 0.0,
            log => contrast::mean_before(whole, log.exp()),
        };
        Before::new(self, mean)
    }

    /// A colour of a part of `whole` before this was done to it, not cut.
    pub fn colour_before(&self, colour: [f32; 3], whole: &Picture) -> [f32; 3] {
        self.before(whole).of(colour)
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

/// In words, with every part that was done.
impl fmt::Display for ToneChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let factors = self.coordinates.map(f32::exp);
        let [red, green, blue] = Self::GAINS.map(|place| factors[place]);
        let grey = |channels: [f32; 3]| GREY.iter().zip(channels).map(|(w, v)| w * v).sum::<f32>();
        let brightness = grey([red, green, blue]);
        let told = [
            ("brightness x", brightness, 1.0),
            ("red x", red / brightness, 1.0),
            ("green x", green / brightness, 1.0),
            ("blue x", blue / brightness, 1.0),
            ("gamma", factors[Self::GAMMA], 1.0),
            ("saturation x", factors[Self::SATURATION], 1.0),
            ("contrast x", factors[Self::CONTRAST], 1.0),
            ("black at", grey(self.fades()), 0.0),
            ("curve bent by", self.coordinates[Self::BEND], 0.0),
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
    fn a_tone_of_all_channels_is_a_change() {
        let before = picture((0..60).map(|i| 0.3 + 0.3 * (i as f32 * 0.37).sin().abs()).collect());
        let done = [
            (Tone::Brightness(1.2), before.pixels.iter().map(|v| v * 1.2).collect()),
            (
                Tone::Gamma(0.8),
                before.pixels.iter().map(|v| v.powf(0.8)).collect::<Vec<f32>>(),
            ),
        ];
        for (tone, pixels) in done {
            let after = ToneChange::of_tone(tone).undone_at_any_rate(&picture(pixels));
            for (a, b) in after.pixels.iter().zip(&before.pixels) {
                assert!((a - b).abs() < 1e-5, "{tone:?}: {a} {b}");
            }
        }
        // Values that were never there are cut, where nobody asks whether they can have been.
        let dark = ToneChange::of_tone(Tone::Brightness(0.5));
        assert_eq!(dark.undone_at_any_rate(&picture(vec![0.9; 3])).pixels, [1.0; 3]);
    }

    /// Places that all have this amount, and what that does to a value.
    type Done<'a> = (&'a [usize], f32, &'a dyn Fn(&f32) -> f32);

    #[test]
    fn fades_and_curves_are_undone() {
        let before = picture((0..90).map(|i| 0.2 + 0.008 * i as f32).collect());
        let sine = |v: &f32| (std::f32::consts::TAU * v).sin() / std::f32::consts::TAU;
        let faded = &ToneChange::FADES[..];
        let bent = &[ToneChange::BEND][..];
        let all: [Done<'_>; 4] = [
            (faded, 0.2, &|v| 0.2 + 0.8 * v),
            (faded, -0.1, &|v| -0.1 + 1.1 * v),
            (bent, 0.6, &|v| v - 0.6 * sine(v)),
            (bent, -0.4, &|v| v + 0.4 * sine(v)),
        ];
        for (places, amount, done) in all {
            let mut change = ToneChange::default();
            places.iter().for_each(|place| change.coordinates[*place] = amount);
            let done = picture(before.pixels.iter().map(done).collect());
            let after = change.undone(&done, &done).unwrap();
            for (a, b) in after.pixels.iter().zip(&before.pixels) {
                assert!((a - b).abs() < 0.002, "{places:?} {amount}: {a} {b}");
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
        let change = ToneChange::of_gains([-0.4; 3]);
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
        ToneChange::FADES
            .iter()
            .for_each(|place| change.coordinates[*place] = 0.1);
        let told = "brightness x 0.81, red x 0.99, green x 0.99, blue x 1.09, saturation x 1.20, black at 0.10 undone";
        assert_eq!(change.to_string(), told);
        assert_eq!(ToneChange::default().to_string(), "tones as they are");
    }
}
