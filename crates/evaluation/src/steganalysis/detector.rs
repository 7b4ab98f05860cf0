//! The detectors of StegExpose by name.
use super::{chi_square, primary_sets, rs, sample_pairs};
use crate::{Error, statistics};
use image::RgbImage;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A detector of replaced least significant bits.
///
/// The set, and what is averaged, are those of Boehm, "StegExpose - A Tool for Detecting LSB Steganography"
/// (arXiv:1410.6656, 2014); the methods are written from their own papers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detector {
    /// Regular and singular groups (Fridrich, Goljan, Du 2001): an embedding rate.
    RsAnalysis,
    /// Trace multisets of adjacent pixels (Dumitrescu, Wu, Wang 2003): an embedding rate.
    SamplePairs,
    /// Pairs of values with equal counts (Westfeld, Pfitzmann 1999): a mean probability.
    ChiSquare,
    /// Primary sets of adjacent pixels (Dumitrescu, Wu, Memon 2002): an embedding rate.
    PrimarySets,
    /// StegExpose's standard fusion: arithmetic mean of those of the four that give a result.
    Fusion,
}

/// Why a detector has nothing to say of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoResult {
    /// There is no group, pair or category of the size that the method counts.
    #[error("too few pixels, or too few values that occur often enough")]
    TooSmall,
    /// The counts fit every embedding rate or none, as those of a constant picture.
    #[error("the equation of the embedding rate has no root")]
    NoRoot,
}

/// What a detector says of a picture.
pub(super) type Estimate = Result<f64, NoResult>;

impl Detector {
    /// All five, in the order of the reports.
    pub const ALL: [Detector; 5] = [
        Detector::RsAnalysis,
        Detector::SamplePairs,
        Detector::ChiSquare,
        Detector::PrimarySets,
        Detector::Fusion,
    ];

    /// Name as in serde, on command lines and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Detector::RsAnalysis => "rs-analysis",
            Detector::SamplePairs => "sample-pairs",
            Detector::ChiSquare => "chi-square",
            Detector::PrimarySets => "primary-sets",
            Detector::Fusion => "fusion",
        }
    }

    /// Estimated share of samples that carry a bit, or probability that they do, in `[0, 1]`.
    ///
    /// # Errors
    /// The reason for which there is no result; of the fusion that of the first detector, where all have none.
    pub fn estimate(self, picture: &RgbImage) -> Result<f64, NoResult> {
        match self {
            Detector::RsAnalysis => rs::estimate(picture),
            Detector::SamplePairs => sample_pairs::estimate(picture),
            Detector::ChiSquare => chi_square::probability(picture),
            Detector::PrimarySets => primary_sets::estimate(picture),
            Detector::Fusion => fuse(&Detector::estimates(picture)),
        }
    }

    /// [`estimate`](Self::estimate) without the reason.
    pub fn score(self, picture: &RgbImage) -> Option<f64> {
        self.estimate(picture).ok()
    }

    /// Of the four detectors that are no fusion, in the order of [`ALL`](Self::ALL).
    pub(super) fn estimates(picture: &RgbImage) -> [Estimate; 4] {
        [
            Detector::RsAnalysis,
            Detector::SamplePairs,
            Detector::ChiSquare,
            Detector::PrimarySets,
        ]
        .map(|detector| detector.estimate(picture))
    }
}

/// Mean of the results that there are.
pub(super) fn fuse(results: &[Estimate]) -> Estimate {
    let valid: Vec<f64> = results.iter().filter_map(|result| result.ok()).collect();
    if valid.is_empty() {
        return Err(results
            .iter()
            .find_map(|result| result.err())
            .unwrap_or(NoResult::TooSmall));
    }
    Ok(valid.iter().sum::<f64>() / valid.len() as f64)
}

impl fmt::Display for Detector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Detector {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        let found = Detector::ALL.into_iter().find(|detector| detector.name() == name);
        found.ok_or_else(|| {
            let names = Detector::ALL.map(Detector::name).join(", ");
            statistics::bad("detector", format!("{name:?} is none of {names}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for detector in Detector::ALL {
            assert_eq!(detector.to_string().parse::<Detector>().unwrap(), detector);
            let json = serde_json::to_string(&detector).unwrap();
            assert_eq!(json, format!("\"{detector}\""));
            assert_eq!(serde_json::from_str::<Detector>(&json).unwrap(), detector);
        }
        assert!("rs".parse::<Detector>().is_err());
    }

    #[test]
    fn fusion_leaves_out_who_has_no_result() {
        let none = Err(NoResult::NoRoot);
        assert_eq!(fuse(&[Ok(0.25), none, Ok(0.75), none]), Ok(0.5));
        assert_eq!(fuse(&[none; 4]), none);
    }
}
