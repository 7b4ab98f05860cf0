//! One step of an attack: what is done, and how strongly.
use std::fmt;
use std::str::FromStr;

use image::{Rgb, RgbImage};
use rand::RngExt;

use super::draw::{RandomSource, RandomStream};
use super::kind::{AttackKind, Grid, Limits};
use super::strength::{Strength, start_of};
use super::{codec, colour, cover, filter, frame, noise, resample, rotate};
use crate::{Error, Result};

/// One step of an attack: what is done, and how strongly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    kind: AttackKind,
    strength: Option<Strength>,
}

impl Step {
    /// A step, if its strength is within the limits of its kind, or absent where it has none.
    ///
    /// # Errors
    /// [`Error::BadOption`] with the limits.
    pub fn new(kind: AttackKind, strength: Option<Strength>) -> Result<Self> {
        let bad = |reason| Error::BadOption {
            field: kind.name(),
            reason,
        };
        match (kind.spec(), strength) {
            (None, None) => {}
            (None, Some(strength)) => return Err(bad(format!("takes no strength, but has {strength}"))),
            (Some(limits), None) => return Err(bad(format!("needs {limits}"))),
            (Some(limits), Some(strength)) => {
                if !(limits.allow(strength.low()) && limits.allow(strength.high())) {
                    return Err(bad(format!("{strength} is not {limits}")));
                }
            }
        }
        Ok(Self { kind, strength })
    }

    /// What is done.
    pub fn kind(self) -> AttackKind {
        self.kind
    }

    /// How strongly, for kinds that have a strength.
    pub fn strength(self) -> Option<Strength> {
        self.strength
    }

    /// The step with the one strength that a picture draws.
    pub(super) fn drawn(self, source: RandomSource) -> Self {
        let (Some(limits), Some(strength)) = (self.kind.spec(), self.strength) else {
            return self;
        };
        Self {
            strength: Some(strength.became(limits.draw(strength, source))),
            ..self
        }
    }

    /// Does it, with the lower end of its strength: ranges are [`Step::drawn`] before.
    pub(super) fn apply(self, picture: RgbImage, source: RandomSource) -> Result<RgbImage> {
        let value = self.strength.map_or(0.0, Strength::low);
        if self.strength.is_some() && self.kind.spec().and_then(|limits| limits.identity) == Some(value) {
            return Ok(picture);
        }
        let random = &mut source.random(RandomStream::Pixels);
        Ok(match self.kind {
            AttackKind::Jpeg => codec::jpeg(&picture, value as u8)?,
            AttackKind::Webp => codec::webp(&picture, value as f32)?,
            AttackKind::Noise => noise::add(picture, value as f32, random),
            AttackKind::Blur => filter::blur(&picture, value as u32),
            AttackKind::Median => filter::median(&picture, value as u32),
            AttackKind::Sharpen => filter::sharpen(&picture, value as f32),
            AttackKind::Scale => resample::scale(&picture, value)?,
            AttackKind::Rescale => resample::rescale(&picture, value)?,
            AttackKind::Fit => resample::fit(picture, value as u32)?,
            AttackKind::Rotate => rotate::rotate(&picture, value),
            AttackKind::QuarterTurns => rotate::quarter_turns(picture, value as u8),
            AttackKind::Flip => image::imageops::flip_horizontal(&picture),
            AttackKind::Crop => frame::crop(&picture, value),
            AttackKind::CropRandom => frame::crop_random(&picture, value, random),
            AttackKind::Window => frame::window(&picture, value as u32),
            AttackKind::Border => frame::border(&picture, value)?,
            AttackKind::Page => frame::page(&picture, value, random)?,
            AttackKind::Brightness => colour::brightness(picture, value),
            AttackKind::Contrast => colour::contrast(picture, value),
            AttackKind::Gamma => colour::gamma(picture, value),
            AttackKind::Hue => colour::hue(picture, value),
            AttackKind::Saturation => colour::saturation(picture, value),
            AttackKind::Grey => colour::saturation(picture, 0.0),
            AttackKind::Bits => colour::bits(picture, value as u32),
            AttackKind::Mask => cover::cover(picture, value, 4, 2.0, Rgb([128; 3]), random),
            // Ratio of sides as torchvision's RandomErasing.
            AttackKind::Erase => cover::cover(picture, value, 1, 3.3, Rgb([0; 3]), random),
        })
    }
}

impl Limits {
    fn allow(self, value: f64) -> bool {
        let on_grid = match self.grid {
            Grid::Real => true,
            Grid::Whole => value.fract() == 0.0,
            Grid::Odd => value.rem_euclid(2.0) == 1.0,
        };
        on_grid && (self.least..=self.most).contains(&value)
    }

    /// Uniform over the numbers that are allowed.
    fn draw(self, strength: Strength, source: RandomSource) -> f64 {
        let (low, high) = (strength.low(), strength.high());
        if strength.is_fixed() {
            return low;
        }
        let random = &mut source.random(RandomStream::Strength);
        let mut whole = |every: f64| low + every * f64::from(random.random_range(0..=((high - low) / every) as u32));
        match self.grid {
            Grid::Whole => whole(1.0),
            Grid::Odd => whole(2.0),
            Grid::Real => random.random_range(low..=high),
        }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = match self.grid {
            Grid::Real => "a number",
            Grid::Whole => "a whole number",
            Grid::Odd => "an odd number",
        };
        write!(f, "{numbers} from {} to {}", self.least, self.most)
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.strength {
            None => f.write_str(self.kind.name()),
            Some(strength) => write!(f, "{}:{strength}", self.kind.name()),
        }
    }
}

impl FromStr for Step {
    type Err = Error;

    /// Reads `flip`, `jpeg:10` or `rotate:-30..30`.
    fn from_str(text: &str) -> Result<Self> {
        let (name, strength) = match text.split_once(':') {
            Some((name, strength)) => (name, Some(strength)),
            None => (text, None),
        };
        let Some(kind) = AttackKind::ALL.into_iter().find(|kind| kind.name() == name) else {
            return Err(Error::BadOption {
                field: "attack",
                reason: format!(
                    "{:?} is none of none, {}",
                    start_of(name),
                    AttackKind::ALL.map(AttackKind::name).join(", ")
                ),
            });
        };
        let strength = strength.map(|text| text.parse().map_err(|error| named(kind, error)));
        Self::new(kind, strength.transpose()?)
    }
}

/// An error of a strength, told of the attack that it is for, with its limits.
fn named(kind: AttackKind, error: Error) -> Error {
    match error {
        Error::BadOption { reason, .. } => Error::BadOption {
            field: kind.name(),
            reason: match kind.spec() {
                Some(limits) => format!("{reason}; needs {limits}"),
                None => format!("{reason}; takes no strength"),
            },
        },
        other => other,
    }
}
