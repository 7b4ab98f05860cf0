//! The learned detector on photographs that it was not trained on.
use super::features::{self, FEATURES};
use super::{Classifier, train};
use crate::statistics::Roc;
use crate::steganalysis::testing::{constant, crops, lsb_matching, noise};
use image::RgbImage;
use image::imageops;

/// Crops of the photographs with an even number, and of those with an odd one.
fn halves() -> Option<[Vec<RgbImage>; 2]> {
    let crops = crops()?;
    Some([0, 1].map(|first| crops.iter().skip(first).step_by(2).flatten().cloned().collect()))
}

fn marked(clean: &[RgbImage], rate: f64) -> Vec<RgbImage> {
    let seeds = 1000..;
    clean
        .iter()
        .zip(seeds)
        .map(|(picture, seed)| lsb_matching(picture, rate, seed))
        .collect()
}

fn roc(classifier: &Classifier, clean: &[RgbImage], marked: &[RgbImage]) -> Roc {
    Roc::new(&classifier.scores(marked), &classifier.scores(clean), 0.95).unwrap()
}

#[test]
fn matched_bits_are_found_in_other_photographs() {
    let Some([seen, fresh]) = halves() else { return };
    for (rate, limit) in [(0.5, 0.99), (0.1, 0.98)] {
        let classifier = train(&seen, &marked(&seen, rate), 1).unwrap();
        let roc = roc(&classifier, &fresh, &marked(&fresh, rate));
        eprintln!(
            "matching at {rate}: area {:.4} {:?}, best {:.3}, at 5 % false alarms {:.3}, out of bag {:.4}",
            roc.area,
            roc.area_interval,
            roc.best.accuracy,
            roc.true_positive_rate_at(0.05),
            classifier.out_of_bag_error()
        );
        assert!(roc.area > limit);
    }
}

/// A change as of Gaussians' colours: smooth, of each channel by itself, of a standard deviation of `levels`.
fn smooth(picture: &RgbImage, levels: f64, seed: u64) -> RgbImage {
    let field = imageops::blur(&noise(picture.width(), picture.height(), seed), 2.0);
    let mean = field.iter().map(|value| f64::from(*value)).sum::<f64>() / field.len() as f64;
    let variance = field
        .iter()
        .map(|value| (f64::from(*value) - mean).powi(2))
        .sum::<f64>()
        / field.len() as f64;
    let factor = levels / variance.sqrt();
    let mut changed = picture.clone();
    for (sample, value) in changed.iter_mut().zip(field.iter()) {
        *sample = (f64::from(*sample) + factor * (f64::from(*value) - mean)).round() as u8;
    }
    changed
}

#[test]
fn smooth_changes_are_found_in_other_photographs() {
    let Some([seen, fresh]) = halves() else { return };
    // About 48 and 58 dB.
    for (levels, limit) in [(1.0, 0.98), (0.3, 0.8)] {
        let change = |pictures: &[RgbImage]| -> Vec<RgbImage> {
            let seeds = 50..;
            pictures
                .iter()
                .zip(seeds)
                .map(|(picture, seed)| smooth(picture, levels, seed))
                .collect()
        };
        let classifier = train(&seen, &change(&seen), 1).unwrap();
        let roc = roc(&classifier, &fresh, &change(&fresh));
        eprintln!(
            "smooth changes of {levels}: area {:.4} {:?}, best {:.3}, out of bag {:.4}",
            roc.area,
            roc.area_interval,
            roc.best.accuracy,
            classifier.out_of_bag_error()
        );
        assert!(roc.area > limit);
    }
}

/// Trained on pictures of which none is marked, it must tell nothing.
#[test]
fn nothing_is_found_where_nothing_is() {
    let Some([seen, fresh]) = halves() else { return };
    // Neighbouring crops, which is which by turns.
    let split = |crops: &[RgbImage]| -> [Vec<RgbImage>; 2] {
        [0, 1].map(|first| {
            crops
                .chunks_exact(2)
                .enumerate()
                .map(|(row, pair)| pair[(row + first) % 2].clone())
                .collect()
        })
    };
    let [clean, others] = split(&seen);
    let classifier = train(&clean, &others, 1).unwrap();
    let [clean, others] = split(&fresh);
    let roc = roc(&classifier, &clean, &others);
    eprintln!("unmarked: area {:.4} {:?}", roc.area, roc.area_interval);
    assert!((roc.area - 0.5).abs() < 0.12, "{}", roc.area);
}

#[test]
fn same_seed_same_classifier() {
    let pictures: Vec<RgbImage> = (0..10).map(|seed| imageops::blur(&noise(24, 24, seed), 2.0)).collect();
    let others = marked(&pictures, 1.0);
    let first = train(&pictures, &others, 5).unwrap();
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let second = alone.install(|| train(&pictures, &others, 5).unwrap());
    assert_eq!(first, second);
    assert_ne!(first, train(&pictures, &others, 6).unwrap());
    // What it was trained on is told apart, and degenerate pictures have a score.
    assert!(first.scores(&others).iter().sum::<f64>() > first.scores(&pictures).iter().sum::<f64>());
    for picture in [
        RgbImage::new(0, 0),
        constant(1, 1, 0),
        constant(3, 9, 255),
        constant(40, 40, 255),
    ] {
        assert!(first.score(&picture).is_finite());
    }
}

#[test]
fn what_cannot_be_learned_from_is_refused() {
    let pictures: Vec<RgbImage> = (0..8).map(|seed| noise(16, 16, seed)).collect();
    assert!(train(&pictures, &pictures[1..], 1).is_err());
    assert!(train(&pictures[1..], &pictures[1..], 1).is_err());
    let mut other = pictures.clone();
    other[3] = noise(16, 17, 3);
    assert!(train(&pictures, &other, 1).is_err());
    let small: Vec<RgbImage> = (0..8).map(|seed| noise(15, 16, seed)).collect();
    assert!(train(&small, &small, 1).is_err());
    // Equal classes are legal: that is an answer too.
    let same = train(&pictures, &pictures, 1).unwrap();
    assert_eq!(same.score(&pictures[0]), 0.0);
}

/// A white background makes flat places more common, and changes no feature but those that are conditional on one.
#[test]
fn white_backgrounds_change_few_features() {
    let Some(crops) = crops() else { return };
    let picture = &crops[0][0];
    let (width, height) = picture.dimensions();
    let mut framed = constant(3 * width, 2 * height, 255);
    imageops::replace(&mut framed, picture, i64::from(width), i64::from(height / 2));
    let (plain, framed) = (features::of(picture), features::of(&framed));
    assert_eq!(plain.len(), FEATURES);
    let flat = |feature: usize| (feature % 343) / 7 == 24;
    let (mut sum, mut largest) = (0.0, 0.0_f64);
    for (feature, (a, b)) in plain.iter().zip(&framed).enumerate() {
        assert!((0.0..=1.0).contains(b));
        if !flat(feature) {
            sum += (a - b).abs();
            largest = largest.max((a - b).abs());
        }
    }
    let mean = sum / FEATURES as f64;
    eprintln!("frame: mean change {mean:.5}, largest {largest:.4}");
    assert!(mean < 0.004, "{mean}");
    // Those of flat places go towards 1.
    assert!(
        (24 * 7 + 3..FEATURES)
            .step_by(343)
            .all(|feature| framed[feature] >= plain[feature])
    );
}
