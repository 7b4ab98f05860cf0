//! How much of an attack: nothing to be told, one strength, or one for each channel.
use std::fmt;

use rand_chacha::ChaCha8Rng;

use super::limits::Limits;
use super::strength::Strength;
use crate::Result;

/// Between the strengths of red, green and blue in texts.
const BETWEEN: char = '/';

/// What is told of a step besides its kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Amount {
    Nothing,
    One(Strength),
    Channels([Strength; 3]),
}

impl Amount {
    /// Reads `0.5`, `0.5..1.5`, or `1.05/1/0.95`.
    pub fn parse(text: &str) -> Result<Self> {
        let parts: Vec<&str> = text.split(BETWEEN).take(4).collect();
        Ok(match parts[..] {
            [red, green, blue] => Self::Channels([red.parse()?, green.parse()?, blue.parse()?]),
            _ => Self::One(text.parse()?),
        })
    }

    /// All strengths in it.
    pub fn strengths(&self) -> &[Strength] {
        match self {
            Self::Nothing => &[],
            Self::One(strength) => std::slice::from_ref(strength),
            Self::Channels(channels) => channels,
        }
    }

    /// Whether nothing is done at all.
    pub fn is_identity(self, limits: Option<Limits>) -> bool {
        let identity = limits.and_then(|limits| limits.identity);
        let same = |strength: &Strength| strength.is_fixed() && Some(strength.low()) == identity;
        !self.strengths().is_empty() && self.strengths().iter().all(same)
    }

    /// One number of each range; of one range for all channels, each draws its own where they are `apart`.
    pub fn drawn(self, limits: Limits, apart: bool, random: &mut ChaCha8Rng) -> Self {
        let mut draw = |strength| limits.draw(strength, random);
        match self {
            Self::Nothing => Self::Nothing,
            Self::One(range) if apart && !range.is_fixed() => Self::Channels([range; 3].map(draw)),
            Self::One(strength) => Self::One(draw(strength)),
            Self::Channels(channels) => Self::Channels(channels.map(draw)),
        }
    }
}

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, strength) in self.strengths().iter().enumerate() {
            if place > 0 {
                write!(f, "{BETWEEN}")?;
            }
            write!(f, "{strength}")?;
        }
        Ok(())
    }
}
