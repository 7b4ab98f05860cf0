//! The curves of all detectors over pictures that are clean and pictures that are suspicious.
use super::detector::{Detector, Estimate, fuse};
use crate::Result;
use crate::statistics::Roc;
use image::RgbImage;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How well a detector tells suspicious pictures from clean ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectorRoc {
    /// Which.
    pub detector: Detector,
    /// The curve over all pictures; suspicious ones are the positives. A picture without a result raises no alarm, so
    /// its score is 0.
    pub roc: Roc,
    /// How many of the clean pictures have no result.
    pub clean_without_result: usize,
    /// How many of the suspicious ones.
    pub suspicious_without_result: usize,
}

/// The curves of [`Detector::ALL`], in that order, at a confidence such as 0.95.
///
/// # Errors
/// No clean picture, no suspicious one, or a confidence outside (0, 1).
pub fn roc_of(clean: &[RgbImage], suspicious: &[RgbImage], confidence: f64) -> Result<Vec<DetectorRoc>> {
    let (clean, suspicious) = (estimates(clean), estimates(suspicious));
    let curve = |(row, detector): (usize, Detector)| {
        let (clean, clean_without_result) = column(&clean, row);
        let (suspicious, suspicious_without_result) = column(&suspicious, row);
        Ok(DetectorRoc {
            detector,
            roc: Roc::new(&suspicious, &clean, confidence)?,
            clean_without_result,
            suspicious_without_result,
        })
    };
    Detector::ALL.into_iter().enumerate().map(curve).collect()
}

/// Of each picture, in the order of [`Detector::ALL`].
fn estimates(pictures: &[RgbImage]) -> Vec<[Estimate; 5]> {
    let of_one = |picture: &RgbImage| {
        let four = Detector::estimates(picture);
        let [rs, pairs, chi_square, primary] = four;
        [rs, pairs, chi_square, primary, fuse(&four)]
    };
    pictures.par_iter().map(of_one).collect()
}

/// Scores of one detector, and how many pictures are without.
fn column(estimates: &[[Estimate; 5]], row: usize) -> (Vec<f64>, usize) {
    let scores = estimates.iter().map(|five| five[row].unwrap_or(0.0)).collect();
    (scores, estimates.iter().filter(|five| five[row].is_err()).count())
}
