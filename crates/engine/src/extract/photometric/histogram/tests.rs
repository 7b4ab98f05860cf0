use burn::tensor::Device;

use super::*;
use crate::clip::{Clip, Parts};
use crate::quality::batch;

const SIDE: usize = 160;
const SCALES: [usize; 3] = [1, 2, 4];

fn picture(side: usize, pixel: impl Fn(usize, usize) -> [f32; 3]) -> Picture {
    Picture {
        width: side as u32,
        height: side as u32,
        pixels: (0..side * side).flat_map(|i| pixel(i % side, i / side)).collect(),
    }
}

/// Surfaces of several colours with shades and texture, on white.
fn scene() -> Picture {
    picture(SIDE, |x, y| {
        if (x as f32 - 79.5).hypot(y as f32 - 79.5) > 60.0 {
            return [1.0; 3];
        }
        let [u, v] = [x, y].map(|at| at as f32 / SIDE as f32);
        let texture = 0.05 * ((x * 37 + y * 91) % 17) as f32 / 17.0;
        match x / 40 % 2 {
            0 => [0.2 + 0.5 * u, 0.3 + 0.2 * v + texture, 0.25],
            _ => [0.3, 0.2 + 0.4 * v, 0.15 + 0.5 * u + texture],
        }
    })
}

/// Channels times these, cut at white.
fn tinted(picture: &Picture, gains: [f32; 3]) -> Picture {
    let channels = picture.pixels.as_chunks::<3>().0.iter();
    Picture {
        pixels: channels
            .flat_map(|pixel| [0, 1, 2].map(|c| (pixel[c] * gains[c]).min(1.0)))
            .collect(),
        ..*picture
    }
}

fn change(gains: [f32; 3]) -> ToneChange {
    ToneChange::of_gains(gains.map(f32::ln))
}

fn cosine(a: &[f32], b: &[f32]) -> f32 {
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

#[test]
fn a_histogram_reads_as_its_picture_does_once_a_change_is_undone() {
    let clip = Clip::shipped(&Device::default(), Parts::Image).unwrap();
    let numbers = |tensor: burn::tensor::Tensor<2>| tensor.into_data().iter::<f32>().collect::<Vec<_>>();
    let of_picture = |picture: &Picture| numbers(clip.image_features(batch(&[picture], &Device::default()).unwrap()));
    let clean = scene();
    let wanted = of_picture(&clean);
    for gains in [[1.0; 3], [0.8; 3], [0.9, 0.8, 0.95], [0.4; 3]] {
        let seen = tinted(&clean, gains);
        let histogram = ColourHistogram::of(&seen, &SCALES, Fineness::FINE);
        let colours = histogram.undone(&change(gains), &seen).unwrap();
        let fewer = colours.iter().map(|scale| scale.colours.len()).sum::<usize>();
        assert!(fewer < SIDE * SIDE / 2, "{fewer}");
        let found = numbers(clip.features_of_colours(&[colours]).unwrap());
        assert!(cosine(&found, &wanted) > 0.98, "{gains:?}: {}", cosine(&found, &wanted));
        // As it is seen it reads otherwise.
        if gains != [1.0; 3] {
            assert!(cosine(&of_picture(&seen), &wanted) < 0.8, "{gains:?}");
        }
    }
}

#[test]
fn squares_are_averaged_and_all_of_them_are_counted() {
    let picture = picture(12, |x, y| [x as f32 / 16.0, y as f32 / 16.0, 0.5]);
    let histogram = ColourHistogram::of(
        &picture,
        &[1, 4],
        Fineness {
            cells: 1e-3,
            most: 1000,
        },
    );
    let scales = histogram.undone(&ToneChange::default(), &picture).unwrap();
    assert_eq!((scales[0].colours.len(), scales[1].colours.len()), (144, 9));
    let mean = |scale: &WeightedColours| {
        let weighted = scale.colours.iter().zip(&scale.counts);
        weighted.map(|(colour, count)| colour[0] * count).sum::<f32>() / scale.counts.iter().sum::<f32>()
    };
    assert!((mean(&scales[0]) - 5.5 / 16.0).abs() < 1e-6 && (mean(&scales[1]) - 5.5 / 16.0).abs() < 1e-6);
    // At most so many, and none is lost.
    let coarse = ColourHistogram::of(&picture, &[1], Fineness { cells: 1e-3, most: 20 });
    let scales = coarse.undone(&ToneChange::default(), &picture).unwrap();
    assert!(scales[0].colours.len() <= 20);
    assert_eq!(scales[0].counts.iter().sum::<f32>(), 144.0);
}

#[test]
fn a_ground_that_is_not_clean_becomes_white_at_all_scales() {
    // A grey square on a ground that is nearly white.
    let seen = picture(16, |x, y| match (4..11).contains(&x) && (4..11).contains(&y) {
        true => [0.4; 3],
        false => [0.97; 3],
    });
    let histogram = ColourHistogram::of(&seen, &[1, 4], Fineness::FINE);
    let scales = histogram.undone(&ToneChange::default(), &seen).unwrap();
    let counted = |scale: &WeightedColours, level: f32| {
        let all = scale.colours.iter().zip(&scale.counts);
        all.filter(|(colour, _)| (colour[0] - level).abs() < 1e-5)
            .map(|(_, count)| count)
            .sum::<f32>()
    };
    assert_eq!((counted(&scales[0], 1.0), counted(&scales[0], 0.4)), (207.0, 49.0));
    // Of sixteen squares one is full, two are three quarters full, and one nine sixteenths.
    assert_eq!((counted(&scales[1], 1.0), counted(&scales[1], 0.4)), (12.0, 1.0));
    assert_eq!(counted(&scales[1], 1.0 - 0.6 * 0.75), 2.0);
    assert_eq!(counted(&scales[1], 1.0 - 0.6 * 9.0 / 16.0), 1.0);
}

#[test]
fn what_would_have_been_brighter_than_white_is_impossible() {
    let of = |scene: f32, ground: f32| {
        picture(40, move |x, y| match x > 4 && x < 36 && y > 4 && y < 36 {
            true => [scene; 3],
            false => [ground; 3],
        })
    };
    let possible = |picture: &Picture, factor: f32| {
        let histogram = ColourHistogram::of(picture, &SCALES, Fineness::FINE);
        let change = change([factor; 3]);
        let all = histogram.undone_at_any_rate(&change, picture);
        assert!(
            all.iter()
                .flat_map(|scale| scale.colours.as_flattened())
                .all(|v| (0.0..=1.0).contains(v))
        );
        histogram.undone(&change, picture).is_some()
    };
    // The ground, and the scene.
    assert!(possible(&of(0.2, 0.8), 0.8) && !possible(&of(0.2, 0.8), 0.7));
    assert!(possible(&of(0.8, 0.2), 0.8) && !possible(&of(0.8, 0.2), 0.7));
    // White and black may have been cut.
    assert!(possible(&of(0.2, 1.0), 0.7));
}
