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
    /// What is paid for beyond what was compared; absent in reports of version 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paid: Option<Multiplicity>,
}

/// What a claim is paid for whatever it names, since whoever claims may have chosen by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multiplicity {
    /// Assets that are registered for the key, of all owners: the claimant may have registered them, and named the one
    /// that fits best.
    pub assets: u64,
    /// Readings that the claimant had made of any of these files, by different views or with different keys, this one
    /// included.
    pub readings: u64,
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
            paid: None,
        }
    }

    /// Readings that were decided on: every variant that was not pooled, and at least one.
    pub fn readings(&self) -> u64 {
        let apart = self.framings.iter().filter(|f| !f.pooled);
        apart.map(|f| u64::from(f.variants)).sum::<u64>().max(1)
    }

    /// Assets that are paid for: those that were compared, and all others that might have been named.
    pub fn assets_paid(&self) -> u64 {
        let all = self.paid.map_or(0, |paid| paid.assets);
        self.assets.max(all).max(1)
    }

    /// Hypotheses that are paid for: each reading against each asset, as often as the suspect was read.
    pub fn hypotheses(&self) -> u64 {
        let times = self.paid.map_or(1, |paid| paid.readings.max(1));
        self.readings().saturating_mul(self.assets_paid()).saturating_mul(times)
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
            paid: None,
        };
        assert_eq!(tried.hypotheses(), 40);
        // One asset that was named out of a thousand, in the third reading of the suspect.
        let named = Tried {
            assets: 1,
            paid: Some(Multiplicity {
                assets: 1000,
                readings: 3,
            }),
            ..tried.clone()
        };
        assert_eq!(named.hypotheses(), 4 * 1000 * 3);
        let endless = Tried {
            assets: u64::MAX,
            ..tried
        };
        assert_eq!(endless.hypotheses(), u64::MAX);
    }
}
