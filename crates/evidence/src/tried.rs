//! What was tried before something was found, since every attempt is paid for.
use serde::{Deserialize, Serialize};

/// What a suspect was compared with, and under which hypotheses about what was done to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tried {
    /// What was undone before the suspect's pictures were read.
    pub framings: Vec<HypothesisGroup>,
    /// Owners whose messages were compared.
    pub owners: u64,
    /// Assets whose messages were compared, of all these owners together; each is one claim.
    pub assets: u64,
}

/// Hypotheses of one kind about what was done to a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HypothesisGroup {
    /// What was done to the picture.
    pub kind: HypothesisKind,
    /// In how many variants, at least one.
    pub variants: u32,
    /// Whether these were pooled with the others into one reading, which is then decided once. Otherwise each is an
    /// attempt of its own, and paid for.
    pub pooled: bool,
}

/// What was done to a picture before it was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HypothesisKind {
    /// Nothing.
    AsGiven,
    /// A part of it.
    Crop,
    /// Turned by 90, 180 or 270 degrees.
    QuarterTurn,
    /// Left and right exchanged.
    Mirrored,
    /// Made larger or smaller.
    Scaling,
    /// Brightness, gamma, contrast or saturation changed back.
    Tone,
}

impl Tried {
    /// One picture as it was given, against one claim.
    pub fn once() -> Self {
        Self {
            framings: vec![HypothesisGroup {
                kind: HypothesisKind::AsGiven,
                variants: 1,
                pooled: false,
            }],
            owners: 1,
            assets: 1,
        }
    }

    /// Readings that were decided on: every variant that was not pooled, and at least one.
    pub fn readings(&self) -> u64 {
        let apart = self.framings.iter().filter(|f| !f.pooled);
        apart.map(|f| u64::from(f.variants)).sum::<u64>().max(1)
    }

    /// Hypotheses that were tried: each reading against each claim.
    pub fn hypotheses(&self) -> u64 {
        self.readings().saturating_mul(self.assets.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_attempt_counts_and_pooled_ones_do_not() {
        assert_eq!(Tried::once().hypotheses(), 1);
        let framing = |kind, variants, pooled| HypothesisGroup { kind, variants, pooled };
        let tried = Tried {
            framings: vec![
                framing(HypothesisKind::AsGiven, 1, false),
                framing(HypothesisKind::QuarterTurn, 3, false),
                framing(HypothesisKind::Crop, 5, true),
            ],
            owners: 2,
            assets: 10,
        };
        assert_eq!(tried.hypotheses(), 40);
        let endless = Tried {
            assets: u64::MAX,
            ..tried
        };
        assert_eq!(endless.hypotheses(), u64::MAX);
    }
}
