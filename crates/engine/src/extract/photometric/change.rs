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
pub(super) const OUTSIDE: f32 = 0.02;

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

    /// The picture before this was done to it, values cut to [0, 1], and white where nobody knows them any more; `None` where
    /// that can't be: what was done can only have been done to values in [0, 1], and many would lie outside. Its contrast was
    /// changed about the mean of `whole`, of which it is a part.
    pub fn undone(&self, picture: &Picture, whole: &Picture) -> Option<Picture> {
        let (before, outside) = self.undone_with_outside(picture, whole);
        (outside <= OUTSIDE * picture.pixels.len() as f32).then_some(before)
    }

    /// The same of a whole picture, whether or not that can be.
    pub fn undone_at_any_rate(&self, picture: &Picture) -> Picture {
        self.undone_with_outside(picture, picture).0
    }

    /// The picture before, and how many of its values would lie outside.
    fn undone_with_outside(&self, picture: &Picture, whole: &Picture) -> (Picture, f32) {
        let mut pixels = vec![0.0; picture.pixels.len()];
        let outside = Instructions::widest().run(Undo {
            before: self.before(whole),
            pixels: picture.pixels.as_chunks().0,
            counts: None,
            out: pixels.as_chunks_mut().0,
        });
        (Picture { pixels, ..*picture }, outside)
    }

    /// What undoes it in a part of `whole`.
    pub(super) fn before(&self, whole: &Picture) -> Before {
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
mod tests;
