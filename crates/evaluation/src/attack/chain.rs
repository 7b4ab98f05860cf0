//! Attacks: steps in a row, as text and on pictures.
use std::fmt;
use std::str::FromStr;

use image::RgbImage;
use serde::{Deserialize, Serialize};

use super::avif;
use super::draw::RandomSource;
use super::kind::AttackKind;
use super::size;
use super::step::Step;
use crate::{Error, Result};

/// Most steps of an attack.
pub const MAX_STEPS: usize = 16;

/// Steps in a row; without any, the picture stays as it is, which is written `none`.
///
/// As text, and so in JSON, steps are joined by `+`: `crop:0.4+brightness:0.5..1.5+jpeg:10`. What is printed reads back
/// as the same attack.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Attack {
    steps: Vec<Step>,
}

impl Attack {
    /// Steps in a row.
    ///
    /// # Errors
    /// [`Error::BadOption`] for more than [`MAX_STEPS`].
    pub fn new(steps: Vec<Step>) -> Result<Self> {
        if steps.len() > MAX_STEPS {
            return Err(Error::BadOption {
                field: "attack",
                reason: format!("more than {MAX_STEPS} steps"),
            });
        }
        Ok(Self { steps })
    }

    /// What is done, in order.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The attack that picture `index` gets: each range becomes the number drawn from it.
    ///
    /// `attack.drawn(seed, index).apply(picture, seed, index)` is the same picture as without `drawn`.
    pub fn drawn(&self, seed: u64, index: u64) -> Self {
        let steps = self.sources(seed, index).map(|(step, source)| step.drawn(source));
        Self { steps: steps.collect() }
    }

    /// A program of the system that the attack needs and that is not there, with what to do about it.
    pub fn missing_program(&self) -> Option<String> {
        let needs = self.steps.iter().any(|step| step.kind() == AttackKind::Avif);
        (needs && !avif::is_installed()).then(|| avif::missing(avif::ENCODER))
    }

    /// The picture after the attack.
    ///
    /// `seed` and `index`, the number of the picture, decide all that is random, each step for itself: a range of
    /// brightness, say, gives a picture the same number in every chain.
    ///
    /// # Errors
    /// [`Error::BadOption`] for a picture of no pixels, or one that is or gets larger than
    /// [`MAX_SIDE`](super::MAX_SIDE) or [`MAX_PIXELS`](super::MAX_PIXELS), and [`Error::Codec`] where a codec fails.
    pub fn apply(&self, picture: &RgbImage, seed: u64, index: u64) -> Result<RgbImage> {
        size::check(picture.dimensions())?;
        self.sources(seed, index)
            .try_fold(picture.clone(), |picture, (step, source)| {
                step.drawn(source).apply(picture, source)
            })
    }

    /// The steps with where their random numbers come from.
    fn sources(&self, seed: u64, index: u64) -> impl Iterator<Item = (Step, RandomSource)> {
        self.steps.iter().enumerate().map(move |(position, step)| {
            let before = self.steps.iter().take(position);
            let occurrence = before.filter(|other| other.kind() == step.kind()).count() as u16;
            let kind = step.kind();
            let source = RandomSource {
                seed,
                index,
                kind,
                occurrence,
            };
            (*step, source)
        })
    }
}

impl fmt::Display for Attack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.steps.is_empty() {
            return f.write_str("none");
        }
        for (position, step) in self.steps.iter().enumerate() {
            let join = if position == 0 { "" } else { "+" };
            write!(f, "{join}{step}")?;
        }
        Ok(())
    }
}

impl FromStr for Attack {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "none" {
            return Ok(Self::default());
        }
        // One more than allowed is enough to refuse it, however long the text.
        let steps = text.split('+').take(MAX_STEPS + 1).map(str::parse);
        Self::new(steps.collect::<Result<_>>()?)
    }
}

impl TryFrom<String> for Attack {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<Attack> for String {
    fn from(attack: Attack) -> Self {
        attack.to_string()
    }
}
