//! One step of an attack: what is done, and how strongly.
use std::fmt;
use std::str::FromStr;

use super::amount::Amount;
use super::draw::{RandomSource, RandomStream};
use super::kind::AttackKind;
use super::libjpeg::{self, Encoder};
use super::strength::{Strength, start_of};
use super::{avif, codec, colour, cover, filter, frame, noise, resample, rotate};
use crate::{Error, Result};
use image::{Rgb, RgbImage};

/// One step of an attack: what is done, and how strongly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    kind: AttackKind,
    amount: Amount,
}

impl Step {
    /// A step, if its strength is within the limits of its kind, or absent where it has none.
    ///
    /// # Errors
    /// [`Error::BadOption`] with the limits.
    pub fn new(kind: AttackKind, strength: Option<Strength>) -> Result<Self> {
        Self::of(kind, strength.map_or(Amount::Nothing, Amount::One))
    }

    /// Red, green and blue times a factor each: [`AttackKind::Tint`].
    ///
    /// # Errors
    /// [`Error::BadOption`] with the limits.
    pub fn tint(factors: [Strength; 3]) -> Result<Self> {
        Self::of(AttackKind::Tint, Amount::Channels(factors))
    }

    fn of(kind: AttackKind, amount: Amount) -> Result<Self> {
        let bad = |reason| Error::BadOption {
            field: kind.name(),
            reason,
        };
        let Some(limits) = kind.spec() else {
            return match amount {
                Amount::Nothing => Ok(Self { kind, amount }),
                _ => Err(bad(format!("takes no strength, but has {amount}"))),
            };
        };
        match amount {
            Amount::Nothing => return Err(bad(format!("needs {limits}"))),
            Amount::Channels(_) if kind != AttackKind::Tint => {
                return Err(bad(format!("{amount} is three numbers; needs {limits}")));
            }
            _ => {}
        }
        match amount.strengths().iter().all(|strength| limits.allow(*strength)) {
            true => Ok(Self { kind, amount }),
            false => Err(bad(format!("{amount} is not {limits}"))),
        }
    }

    /// What is done.
    pub fn kind(self) -> AttackKind {
        self.kind
    }

    /// How strongly, for kinds that have a strength; of channels with strengths of their own, see [`Step::channels`].
    pub fn strength(self) -> Option<Strength> {
        match self.amount {
            Amount::One(strength) => Some(strength),
            Amount::Nothing | Amount::Channels(_) => None,
        }
    }

    /// The strengths of red, green and blue, where each has its own.
    pub fn channels(self) -> Option<[Strength; 3]> {
        match self.amount {
            Amount::Channels(channels) => Some(channels),
            Amount::Nothing | Amount::One(_) => None,
        }
    }

    /// The step with the one strength that a picture draws.
    pub(super) fn drawn(self, source: RandomSource) -> Self {
        let Some(limits) = self.kind.spec() else {
            return self;
        };
        let random = &mut source.random(RandomStream::Strength);
        Self {
            amount: self.amount.drawn(limits, self.kind == AttackKind::Tint, random),
            ..self
        }
    }

    /// Does it, with the lower end of its strength: ranges are [`Step::drawn`] before.
    pub(super) fn apply(self, picture: RgbImage, source: RandomSource) -> Result<RgbImage> {
        if self.amount.is_identity(self.kind.spec()) {
            return Ok(picture);
        }
        let value = self.strength().map_or(0.0, Strength::low);
        let random = &mut source.random(RandomStream::Pixels);
        Ok(match self.kind {
            AttackKind::Jpeg => codec::jpeg(&picture, value as u8)?,
            AttackKind::Webp => codec::webp(&picture, value as f32)?,
            AttackKind::JpegTurbo => libjpeg::written(Encoder::Turbo, &picture, value as u8)?,
            AttackKind::Mozjpeg => libjpeg::written(Encoder::Mozjpeg, &picture, value as u8)?,
            AttackKind::Avif => avif::written(&picture, value as u8)?,
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
            AttackKind::Tint => {
                let factors = self.channels().map(|channels| channels.map(Strength::low));
                colour::tint(picture, factors.unwrap_or([value; 3]))
            }
            AttackKind::Vignette => colour::vignette(picture, value),
            AttackKind::Contrast => colour::contrast(picture, value),
            AttackKind::Gamma => colour::gamma(picture, value),
            AttackKind::Fade => colour::fade(picture, value),
            AttackKind::Curve => colour::curve(picture, value),
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

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.amount {
            Amount::Nothing => f.write_str(self.kind.name()),
            amount => write!(f, "{}:{amount}", self.kind.name()),
        }
    }
}

impl FromStr for Step {
    type Err = Error;

    /// Reads `flip`, `jpeg:10`, `rotate:-30..30` or `tint:1.05/1/0.95`.
    fn from_str(text: &str) -> Result<Self> {
        let (name, amount) = match text.split_once(':') {
            Some((name, amount)) => (name, Some(amount)),
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
        let amount = amount.map(|text| Amount::parse(text).map_err(|error| named(kind, error)));
        Self::of(kind, amount.transpose()?.unwrap_or(Amount::Nothing))
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
