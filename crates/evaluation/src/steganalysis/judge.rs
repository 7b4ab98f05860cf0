//! Judges over pictures of several scenes: what every detector makes of clean and of suspicious views.
//!
//! The learned detector judges a scene by what it learned of the others, never of the same: views of one scene are too
//! alike. Intervals take scenes for what is repeated, not views.
use super::detector::{Detector, fuse};
use super::learned::{self, Features, MIN_PAIRS};
use crate::Result;
use crate::statistics::{Cluster, Roc, bad, clustered_area};
use image::RgbImage;
use rayon::prelude::*;
use std::fmt;

/// What the learned detector is called.
const LEARNED: &str = "learned";
/// Seeds of the learned detector; its scores are their means.
const SEEDS: [u64; 3] = [1, 2, 3];
/// Confidence of intervals.
const CONFIDENCE: f64 = 0.95;

/// Who judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steganalyzer {
    /// A detector of replaced bits, which needs no examples.
    Fixed(Detector),
    /// The one that learns from pairs of other scenes.
    Learned,
}

impl Steganalyzer {
    /// All six, in the order of the reports.
    pub const ALL: [Steganalyzer; 6] = [
        Steganalyzer::Fixed(Detector::RsAnalysis),
        Steganalyzer::Fixed(Detector::SamplePairs),
        Steganalyzer::Fixed(Detector::ChiSquare),
        Steganalyzer::Fixed(Detector::PrimarySets),
        Steganalyzer::Fixed(Detector::Fusion),
        Steganalyzer::Learned,
    ];

    /// Whether it can judge so many scenes with so many pairs of pictures each.
    ///
    /// # Errors
    /// Says what is lacking.
    pub fn can_detect(self, pairs: &[usize]) -> std::result::Result<(), String> {
        if self != Steganalyzer::Learned {
            return Ok(());
        }
        if pairs.len() < 2 {
            return Err("is trained on other scenes than it judges, and there is one".into());
        }
        let total: usize = pairs.iter().sum();
        let fewest = pairs.iter().map(|own| total - own).min().unwrap_or(0);
        if fewest < MIN_PAIRS {
            return Err(format!(
                "has {fewest} pairs of other scenes to learn from, fewer than {MIN_PAIRS}"
            ));
        }
        Ok(())
    }
}

impl fmt::Display for Steganalyzer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Steganalyzer::Fixed(detector) => detector.fmt(f),
            Steganalyzer::Learned => f.pad(LEARNED),
        }
    }
}

/// What judges need of a picture; much less than the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorInputs {
    /// Of each of [`Detector::ALL`]; 0, no alarm, where there is no result.
    scores: [f64; 5],
    features: Features,
}

impl DetectorInputs {
    /// Looks at a picture.
    pub fn of(picture: &RgbImage) -> Self {
        let four = Detector::estimates(picture);
        let [rs, pairs, chi_square, primary] = four;
        Self {
            scores: [rs, pairs, chi_square, primary, fuse(&four)].map(|score| score.unwrap_or(0.0)),
            features: Features::of(picture),
        }
    }

    /// Of several pictures, in their order.
    pub fn of_all(pictures: &[RgbImage]) -> Vec<Self> {
        pictures.par_iter().map(Self::of).collect()
    }
}

/// Views of one scene: each of `suspicious` is the same view as that of `clean`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pairs {
    /// Unmarked.
    pub clean: Vec<DetectorInputs>,
    /// Marked, or with replaced bits.
    pub suspicious: Vec<DetectorInputs>,
}

/// What a judge said.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionResult {
    /// Scores of clean views, scene by scene; a higher score says "marked".
    pub clean: Vec<f64>,
    /// Of suspicious ones.
    pub suspicious: Vec<f64>,
    /// Area under the ROC curve, 0..=1.
    pub area: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// How many scenes the interval is over; `None` if there is one, where it is over its views, and too short.
    pub clusters: Option<usize>,
}

/// Lets one judge look at all scenes.
///
/// # Errors
/// Without pairs, or where [`Steganalyzer::can_detect`] says no.
pub fn judge(judge: Steganalyzer, scenes: &[Pairs]) -> Result<DetectionResult> {
    if let Some(row) = scenes
        .iter()
        .position(|pairs| pairs.clean.len() != pairs.suspicious.len())
    {
        return Err(bad("scenes", format!("scene {row} has views without their pairs")));
    }
    let pairs: Vec<usize> = scenes.iter().map(|pairs| pairs.clean.len()).collect();
    judge
        .can_detect(&pairs)
        .map_err(|reason| bad("detector", format!("{judge} {reason}")))?;
    let clusters = match judge {
        Steganalyzer::Fixed(detector) => {
            let place = Detector::ALL.iter().position(|known| *known == detector).unwrap_or(0);
            let scores = |of: &[DetectorInputs]| of.iter().map(|one| one.scores[place]).collect();
            let cluster = |pairs: &Pairs| Cluster {
                positives: scores(&pairs.suspicious),
                negatives: scores(&pairs.clean),
            };
            scenes.iter().map(cluster).collect()
        }
        Steganalyzer::Learned => {
            let each = scenes.iter().enumerate();
            each.map(|(place, own)| learned(scenes, place, own))
                .collect::<Result<Vec<_>>>()?
        }
    };
    verdict(&clusters)
}

/// Scores of `own`, which is scene `held_out`, by detectors that were trained on all others.
fn learned(scenes: &[Pairs], held_out: usize, own: &Pairs) -> Result<Cluster> {
    let others = |of: fn(&Pairs) -> &[DetectorInputs]| -> Vec<&Features> {
        let others = scenes.iter().enumerate().filter(|(place, _)| *place != held_out);
        others
            .flat_map(|(_, pairs)| of(pairs))
            .map(|one| &one.features)
            .collect()
    };
    let (clean, suspicious) = (others(|pairs| &pairs.clean), others(|pairs| &pairs.suspicious));
    let classifiers = SEEDS
        .iter()
        .map(|seed| learned::train_on(&clean, &suspicious, *seed))
        .collect::<Result<Vec<_>>>()?;
    let score = |one: &DetectorInputs| {
        let sum: f64 = classifiers
            .iter()
            .map(|classifier| classifier.score_of(&one.features))
            .sum();
        sum / SEEDS.len() as f64
    };
    Ok(Cluster {
        positives: own.suspicious.iter().map(score).collect(),
        negatives: own.clean.iter().map(score).collect(),
    })
}

fn verdict(clusters: &[Cluster]) -> Result<DetectionResult> {
    let clean: Vec<f64> = clusters.iter().flat_map(|c| c.negatives.clone()).collect();
    let suspicious: Vec<f64> = clusters.iter().flat_map(|c| c.positives.clone()).collect();
    let (area, over_scenes) = clustered_area(clusters, CONFIDENCE)?;
    let over_views = || Ok(Roc::new(&suspicious, &clean, CONFIDENCE)?.area_interval);
    let interval = match over_scenes {
        Some(interval) => Some(interval),
        None => over_views()?,
    };
    Ok(DetectionResult {
        area,
        // One view of each says nothing.
        interval: interval.map_or([0.0, 1.0], |ends| [ends.low.min(area), ends.high.max(area)]),
        clusters: over_scenes.map(|_| clusters.len()),
        clean,
        suspicious,
    })
}

#[cfg(test)]
mod tests {
    use super::super::control::replace_bits;
    use super::super::testing::noise;
    use super::*;
    use image::imageops;

    /// Views as renders are: smooth, with a white ground.
    fn views(scene: u64, count: u64) -> Vec<RgbImage> {
        let view = |index: u64| {
            let mut view = RgbImage::from_pixel(64, 64, image::Rgb([255; 3]));
            let content = imageops::blur(&noise(48, 48, 1000 * scene + index), 1.5);
            imageops::replace(&mut view, &content, 8, 8);
            view
        };
        (0..count).map(view).collect()
    }

    fn pairs(clean: &[RgbImage], change: impl Fn(&RgbImage, u64) -> RgbImage) -> Pairs {
        let suspicious: Vec<RgbImage> = clean.iter().zip(0..).map(|(view, seed)| change(view, seed)).collect();
        Pairs {
            clean: DetectorInputs::of_all(clean),
            suspicious: DetectorInputs::of_all(&suspicious),
        }
    }

    fn scenes(change: impl Fn(&RgbImage, u64) -> RgbImage) -> Vec<Pairs> {
        (1..4).map(|scene| pairs(&views(scene, 8), &change)).collect()
    }

    #[test]
    fn identical_pictures_are_told_apart_by_nobody() {
        let scenes = scenes(|view, _| view.clone());
        for one in Steganalyzer::ALL {
            let verdict = judge(one, &scenes).unwrap();
            assert!((verdict.area - 0.5).abs() < 1e-12, "{one}: {}", verdict.area);
            assert!(verdict.interval.iter().all(|end| (end - 0.5).abs() < 1e-9), "{one}");
            assert_eq!((verdict.clean.len(), verdict.suspicious.len()), (24, 24));
            assert_eq!(verdict.clusters, Some(3));
        }
    }

    #[test]
    fn replaced_bits_are_found() {
        let scenes = scenes(|view, seed| replace_bits(view, 0.5, seed));
        for (one, limit) in Steganalyzer::ALL.into_iter().zip([0.95, 0.95, 0.5, 0.95, 0.95, 0.95]) {
            let verdict = judge(one, &scenes).unwrap();
            eprintln!("{one}: {:.3} {:?}", verdict.area, verdict.interval);
            assert!(verdict.area >= limit, "{one}: {}", verdict.area);
        }
    }

    #[test]
    fn the_learned_one_needs_other_scenes() {
        let scenes = scenes(|view, seed| replace_bits(view, 0.5, seed));
        let reason = judge(Steganalyzer::Learned, &scenes[..1]).unwrap_err().to_string();
        assert!(reason.contains("learned is trained on other scenes"), "{reason}");
        let reason = Steganalyzer::Learned.can_detect(&[20, 3, 4]).unwrap_err();
        assert!(reason.contains("has 7 pairs"), "{reason}");
        // One scene: the others judge it, and the interval says that it is over views.
        let verdict = judge(Steganalyzer::Fixed(Detector::Fusion), &scenes[..1]).unwrap();
        assert_eq!(verdict.clusters, None);
        assert!(
            judge(Steganalyzer::Learned, &[]).is_err() && judge(Steganalyzer::Fixed(Detector::Fusion), &[]).is_err()
        );
    }

    #[test]
    fn judging_twice_gives_the_same() {
        let scenes = scenes(|view, seed| replace_bits(view, 0.1, seed));
        assert_eq!(
            judge(Steganalyzer::Learned, &scenes).unwrap(),
            judge(Steganalyzer::Learned, &scenes).unwrap()
        );
    }
}
