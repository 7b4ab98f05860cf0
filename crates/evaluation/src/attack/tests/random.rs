//! What is drawn: reproducible, of the asked distribution, and different from picture to picture.
use image::{Rgb, RgbImage};

use super::{attack, varied};

const RANDOM: [&str; 8] = [
    "noise:0.1",
    "rotate:-30..30",
    "scale:0.25..4",
    "brightness:0.5..1.5",
    "tint:0.5..1.5",
    "crop-random:0.3",
    "mask:0.2",
    "erase:0.2",
];

#[test]
fn seed_and_index_reproduce_and_differ() {
    let picture = varied(90, 70);
    for text in RANDOM {
        let apply = |seed, index| attack(text).apply(&picture, seed, index).unwrap();
        assert_eq!(apply(1, 2), apply(1, 2), "{text}");
        assert_ne!(apply(1, 2), apply(1, 3), "{text}");
        assert_ne!(apply(1, 2), apply(2, 2), "{text}");
        assert_ne!(apply(1, 2), apply(2, 1), "{text}");
    }
}

#[test]
fn what_is_drawn_can_be_told_beforehand() {
    let picture = varied(60, 50);
    let range = attack("tint:0.8..1.2+crop-random:0.3..0.9+brightness:0.5..1.5+noise:0.05..0.2+blur:3..9+jpeg:10..90");
    for index in 0..10 {
        let drawn = range.drawn(7, index);
        assert_eq!(drawn.drawn(7, index), drawn);
        let told = drawn.apply(&picture, 7, index).unwrap();
        assert_eq!(told, range.apply(&picture, 7, index).unwrap(), "{drawn}");
    }
    assert_ne!(range.drawn(7, 0), range.drawn(7, 1));
    let [red, green, blue] = range.drawn(7, 0).steps()[0].channels().unwrap();
    assert!(red != green && green != blue && blue != red);
}

#[test]
fn the_stream_of_numbers_never_changes() {
    // Results that were published stay reproducible; a change here breaks them.
    let drawn = attack("rotate:-30..30+jpeg:1..100+blur:3..31").drawn(1, 2);
    assert_eq!(drawn.to_string(), "rotate:27.1959002645223+jpeg:8+blur:9");
    let noisy = attack("noise:0.1")
        .apply(&RgbImage::from_pixel(2, 1, Rgb([128; 3])), 1, 2)
        .unwrap();
    assert_eq!(noisy.as_raw().as_slice(), [96, 149, 131, 158, 61, 159]);
}

#[test]
fn ranges_are_drawn_uniformly_with_both_ends() {
    let one = |text: &str, index| attack(text).drawn(11, index).steps()[0].strength().unwrap().low();
    let turns: Vec<f64> = (0..2000).map(|index| one("rotate:-30..30", index)).collect();
    let mean = turns.iter().sum::<f64>() / 2000.0;
    let variance = turns.iter().map(|turn| (turn - mean).powi(2)).sum::<f64>() / 2000.0;
    // 60² / 12 = 300, within four standard errors.
    assert!(mean.abs() < 1.6 && (variance - 300.0).abs() < 24.0, "{mean} {variance}");
    for (text, allowed) in [("bits:5..7", [5.0, 6.0, 7.0]), ("blur:3..7", [3.0, 5.0, 7.0])] {
        for value in allowed {
            let count = (0..600).filter(|index| one(text, *index) == value).count();
            assert!((150..250).contains(&count), "{text} {value}: {count}");
        }
    }
}

#[test]
fn noise_has_the_asked_deviation() {
    let grey = RgbImage::from_pixel(256, 256, Rgb([128; 3]));
    for (sigma, deviation) in [(0.1, 25.5), (0.01, 2.55)] {
        let noisy = attack(&format!("noise:{sigma}")).apply(&grey, 1, 0).unwrap();
        let count = noisy.len() as f64;
        let mean = noisy.iter().map(|value| f64::from(*value)).sum::<f64>() / count;
        let variance = noisy
            .iter()
            .map(|value| (f64::from(*value) - mean).powi(2))
            .sum::<f64>()
            / count;
        assert!((mean - 128.0).abs() < 0.25, "{mean}");
        // Rounding adds a twelfth.
        let expected: f64 = f64::sqrt(deviation * deviation + 1.0 / 12.0);
        assert!((variance.sqrt() / expected - 1.0).abs() < 0.007, "{}", variance.sqrt());
    }
}

#[test]
fn noise_is_independent_between_channels_pixels_and_steps() {
    let grey = RgbImage::from_pixel(128, 128, Rgb([128; 3]));
    let deviations = |text: &str| {
        let noisy = attack(text).apply(&grey, 1, 0).unwrap().into_raw();
        noisy
            .into_iter()
            .map(|value| f64::from(value) - 128.0)
            .collect::<Vec<_>>()
    };
    let noise = deviations("noise:0.1");
    for shift in [1, 2, 3, 128 * 3] {
        let products = noise.iter().zip(noise.iter().skip(shift)).map(|(a, b)| a * b);
        let correlation = products.sum::<f64>() / noise.iter().map(|a| a * a).sum::<f64>();
        assert!(correlation.abs() < 0.02, "{shift}: {correlation}");
    }
    // Twice the same noise would have twice its deviation, not √2 times.
    let power = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let ratio = power(&deviations("noise:0.05+noise:0.05")) / power(&deviations("noise:0.05"));
    assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
}
