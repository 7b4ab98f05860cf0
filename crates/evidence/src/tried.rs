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
    /// Of how many equal parts of the rate each variant has one, so that it pays as one of so many hypotheses; absent in
    /// reports before version 3, where all readings paid alike, and where they were pooled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tries: Option<u64>,
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
    /// What was done to tones, and which part shows the scene, estimated from the picture and the key alone. Not before
    /// version 3.
    Estimated,
    /// What was done to one of several pictures, the others as they agree with it. Not before version 4.
    Led,
    /// Anything: it was compared with the unmarked original. Not before version 5.
    Registered,
}

impl Tried {
    /// One picture as it was given, against one claim.
    pub fn once() -> Self {
        Self {
            framings: vec![HypothesisGroup {
                kind: HypothesisKind::AsGiven,
                variants: 1,
                pooled: false,
                tries: Some(1),
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

    /// Hypotheses that a reading with one of `tries` parts of the rate pays for: as many, against each asset, as often as
    /// the suspect was read.
    pub fn hypotheses(&self, tries: u64) -> u64 {
        let times = self.paid.map_or(1, |paid| paid.readings.max(1));
        tries.saturating_mul(self.assets_paid()).saturating_mul(times)
    }

    /// The parts of the rate that a reading may have one of. Before version 3 there were as many as readings.
    pub fn parts(&self) -> Vec<u64> {
        let apart = self.framings.iter().filter(|group| !group.pooled);
        let parts: Vec<u64> = apart.filter_map(|group| group.tries).collect();
        match parts.is_empty() {
            true => vec![self.readings()],
            false => parts,
        }
    }

    /// How much of the rate all readings have together: 1 at most, or too much was tried.
    pub fn rate_given(&self) -> f64 {
        let apart = self.framings.iter().filter(|group| !group.pooled);
        let parts = apart.filter_map(|group| Some(f64::from(group.variants) / group.tries? as f64));
        parts.sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_attempt_counts_and_pooled_ones_do_not() {
        assert_eq!((Tried::once().parts(), Tried::once().hypotheses(1)), (vec![1], 1));
        let framing = |kind, variants, pooled| HypothesisGroup {
            kind,
            variants,
            pooled,
            tries: None,
        };
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
        // As before version 3.
        assert_eq!((tried.parts(), tried.hypotheses(4)), (vec![4], 40));
        // One asset that was named out of a thousand, in the third reading of the suspect.
        let named = Tried {
            assets: 1,
            paid: Some(Multiplicity {
                assets: 1000,
                readings: 3,
            }),
            ..tried.clone()
        };
        assert_eq!(named.hypotheses(4), 4 * 1000 * 3);
        let endless = Tried {
            assets: u64::MAX,
            ..tried
        };
        assert_eq!(endless.hypotheses(2), u64::MAX);
    }

    #[test]
    fn shares_are_no_more_than_the_rate() {
        let group = |kind, variants, tries| HypothesisGroup {
            kind,
            variants,
            pooled: false,
            tries: Some(tries),
        };
        let mut tried = Tried {
            framings: vec![
                group(HypothesisKind::AsGiven, 1, 2),
                group(HypothesisKind::Estimated, 1, 4),
                group(HypothesisKind::Tone, 50, 200),
            ],
            ..Tried::once()
        };
        assert_eq!((tried.parts(), tried.rate_given()), (vec![2, 4, 200], 1.0));
        tried.framings[2].variants = 51;
        assert!(tried.rate_given() > 1.0);
    }
}
