//! A detector that learns from examples what a mark does to pictures, without knowing how it is made.
//!
//! The classical recipe of steganalysis: features that describe how neighbouring pixels differ (Pevny, Bas, Fridrich,
//! "Steganalysis by subtractive pixel adjacency matrix", IEEE TIFS 5, 2010), judged by an ensemble of Fisher linear
//! discriminants on random subspaces (Kodovsky, Fridrich, Holub, "Ensemble classifiers for steganalysis of digital
//! media", IEEE TIFS 7, 2012). It needs no GPU and little data. What it is worth is measured on pictures of scenes that
//! it was not trained on: views of one scene are too alike.
mod cholesky;
mod discriminant;
mod ensemble;
mod features;
mod spam;
#[cfg(test)]
mod tests;

use crate::Result;
use crate::statistics::bad;
use ensemble::Ensemble;
use image::RgbImage;
use rayon::prelude::*;

/// Fewest pairs of pictures that are learned from; for a useful answer take a hundred or more.
pub const MIN_PAIRS: usize = 8;
/// Smallest width and height of pictures that are learned from, in pixels.
pub const MIN_SIDE: u32 = 16;

/// What was learned; made by [`train`].
#[derive(Clone, Debug, PartialEq)]
pub struct Classifier {
    ensemble: Ensemble,
}

/// Learns to tell `marked[i]` from `clean[i]`, the same view of the same scene without the mark.
///
/// The same pictures and `seed` give the same classifier, whatever the number of threads.
///
/// # Errors
/// Lists or pairs of different sizes, fewer pairs than [`MIN_PAIRS`], or a picture smaller than [`MIN_SIDE`].
pub fn train(clean: &[RgbImage], marked: &[RgbImage], seed: u64) -> Result<Classifier> {
    check_pairs(clean.len(), marked.len())?;
    for (row, (clean, marked)) in clean.iter().zip(marked).enumerate() {
        if clean.dimensions() != marked.dimensions() {
            let (sizes, others) = (marked.dimensions(), clean.dimensions());
            return Err(bad(
                "marked",
                format!("picture {row} has {sizes:?} pixels, the clean one {others:?}"),
            ));
        }
        if clean.width().min(clean.height()) < MIN_SIDE {
            let sizes = clean.dimensions();
            return Err(bad(
                "clean",
                format!("picture {row} has {sizes:?} pixels, fewer than {MIN_SIDE} a side"),
            ));
        }
    }
    let features = |pictures: &[RgbImage]| -> Vec<Vec<f64>> { pictures.par_iter().map(features::of).collect() };
    Ok(Classifier {
        ensemble: Ensemble::train(&features(clean), &features(marked), seed),
    })
}

/// What is looked at of a picture: all that training and judging need of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Features(Vec<f64>);

impl Features {
    /// Of a picture; those of one smaller than [`MIN_SIDE`] are of little use.
    pub fn of(picture: &RgbImage) -> Self {
        Self(features::of(picture))
    }
}

/// As [`train`], from features: for those who train several times on the same pictures.
///
/// # Errors
/// Lists of different sizes, or fewer pairs than [`MIN_PAIRS`].
pub fn train_on(clean: &[&Features], marked: &[&Features], seed: u64) -> Result<Classifier> {
    check_pairs(clean.len(), marked.len())?;
    let rows = |all: &[&Features]| -> Vec<Vec<f64>> { all.iter().map(|one| one.0.clone()).collect() };
    Ok(Classifier {
        ensemble: Ensemble::train(&rows(clean), &rows(marked), seed),
    })
}

fn check_pairs(clean: usize, marked: usize) -> Result<()> {
    if clean != marked {
        return Err(bad("marked", format!("{marked} pictures for {clean} clean ones")));
    }
    if clean < MIN_PAIRS {
        return Err(bad("clean", format!("{clean} pairs are fewer than {MIN_PAIRS}")));
    }
    Ok(())
}

impl Classifier {
    /// How much a picture looks marked: above 0 like those that were, below like those that were not, in standard
    /// deviations of a single discriminant. Finite for every picture; one of fewer than four pixels a side has nothing
    /// to count, and gets what a picture without any neighbours would.
    pub fn score(&self, picture: &RgbImage) -> f64 {
        self.ensemble.score(&features::of(picture))
    }

    /// [`score`](Self::score) of the picture that these are the features of.
    pub fn score_of(&self, features: &Features) -> f64 {
        self.ensemble.score(&features.0)
    }

    /// Of several pictures, in their order.
    pub fn scores(&self, pictures: &[RgbImage]) -> Vec<f64> {
        pictures.par_iter().map(|picture| self.score(picture)).collect()
    }

    /// Share of pictures in the training set, 0 to 1, that discriminants misjudge that were not trained on them. It is
    /// too small where the set has several views of a scene, since others of them were learned from.
    pub fn out_of_bag_error(&self) -> f64 {
        self.ensemble.out_of_bag_error()
    }
}
