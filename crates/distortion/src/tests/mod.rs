//! What holds for every distortion, alone and in mixed batches.
mod layer;

use burn::tensor::Tensor;

use crate::testing::*;
use crate::*;

const GREY: [f32; 3] = [0.5; 3];

fn apply(draws: &[Draw], pictures: Tensor<4>, background: [f32; 3]) -> Tensor<4> {
    Layer::default().apply_with(draws, pictures, background).unwrap()
}

/// Each distortion at strengths up to the ends of its range, none of them clean.
fn strong() -> Vec<Draw> {
    let crop = |keep, at| Crop { keep, at };
    let jpeg = |quality, chroma| Jpeg {
        quality,
        chroma,
        noise: None,
    };
    let bar = |at| Rectangle {
        at,
        height: 0.5,
        width: 0.2,
    };
    vec![
        Draw::Crop(crop(0.4, [0.5; 2])),
        Draw::Crop(crop(0.0, [1.0, 0.0])),
        Draw::Scaling(0.75),
        Draw::Scaling(1.25),
        Draw::Scaling(0.05),
        Draw::Rotation(30.0),
        Draw::Rotation(-179.0),
        Draw::Brightness(0.5),
        Draw::Brightness(1.5),
        Draw::Contrast(0.5),
        Draw::Contrast(1.5),
        Draw::Jpeg(jpeg(10, Chroma::Half)),
        Draw::Jpeg(jpeg(10, Chroma::Full)),
        Draw::Noise(Noise { sigma: 0.1, seed: 3 }),
        Draw::Blur(0.8),
        Draw::Blur(10.0),
        Draw::Mask(vec![bar([0.0; 2]), bar([1.0; 2])]),
        Draw::EightBit,
        Draw::Combined(Combined {
            crop: crop(0.4, [0.1, 0.9]),
            brightness: 1.2,
            jpeg: jpeg(10, Chroma::Half),
        }),
    ]
}

#[test]
fn any_size_keeps_its_shape_and_range_and_gradients_are_finite() {
    for (h, w) in [(1, 1), (1, 7), (9, 2), (16, 16), (33, 47)] {
        let n = 3 * h * w;
        for picture in [vec![0.0; n], vec![1.0; n], random(n, 0.0, 1.0, 1)] {
            let input = pictures(&picture, [1, 3, h, w]);
            for draw in strong() {
                let found = apply(std::slice::from_ref(&draw), input.clone(), GREY);
                assert_eq!(found.dims(), [1, 3, h, w], "{draw:?}");
                let inside = |v: &f32| (-1e-5..=1.0 + 1e-5).contains(v);
                assert!(host(found).iter().all(inside), "{draw:?} {h} x {w}");
                let weights = random(n, -1.0, 1.0, 2);
                let slopes = gradient(|x| apply(std::slice::from_ref(&draw), x, GREY), &input, &weights);
                assert!(slopes.iter().all(|s| s.is_finite()), "{draw:?} {h} x {w}");
            }
        }
    }
}

#[test]
fn gradients_agree_with_central_differences_where_it_is_smooth() {
    let input = random_pictures([1, 3, 11, 14], 4);
    let noisy = Jpeg {
        quality: 90,
        chroma: Chroma::Half,
        noise: Some(5),
    };
    let smooth = [
        Draw::Crop(Crop {
            keep: 0.6,
            at: [0.2, 0.9],
        }),
        Draw::Scaling(0.75),
        Draw::Scaling(1.25),
        Draw::Rotation(-17.0),
        Draw::Brightness(1.1),
        Draw::Contrast(1.1),
        Draw::Jpeg(noisy),
        Draw::Noise(Noise { sigma: 0.02, seed: 3 }),
        Draw::Blur(0.8),
        Draw::Mask(vec![Rectangle {
            at: [0.3, 0.6],
            height: 0.4,
            width: 0.4,
        }]),
        Draw::Combined(Combined {
            crop: Crop {
                keep: 0.8,
                at: [0.5; 2],
            },
            brightness: 0.9,
            jpeg: noisy,
        }),
    ];
    for draw in smooth {
        println!("{draw:?}");
        check_gradient(|x| apply(std::slice::from_ref(&draw), x, GREY), &input, 0.01, 1e-3);
    }
    // Rounding lets gradients through unchanged.
    let weights = random(3 * 11 * 14, -1.0, 1.0, 2);
    let found = gradient(|x| apply(&[Draw::EightBit], x, GREY), &input, &weights);
    assert!(found.iter().zip(&weights).all(|(f, w)| (f - w).abs() < 1e-6));
}

#[test]
fn parameters_of_the_identity_change_nothing_not_even_gradients_at_the_ends_of_the_range() {
    let same = [
        Draw::Clean,
        Draw::Crop(Crop {
            keep: 1.0,
            at: [0.3; 2],
        }),
        Draw::Scaling(1.0),
        Draw::Rotation(0.0),
        Draw::Brightness(1.0),
        Draw::Contrast(1.0),
        Draw::Noise(Noise { sigma: 0.0, seed: 1 }),
        Draw::Blur(0.0),
        Draw::Mask(Vec::new()),
    ];
    let n = 3 * 9 * 13;
    let weights = random(n, -1.0, 1.0, 2);
    for picture in [random(n, 0.0, 1.0, 6), vec![1.0; n], vec![0.0; n]] {
        let input = pictures(&picture, [1, 3, 9, 13]);
        for draw in &same {
            let f = |x| apply(std::slice::from_ref(draw), x, [0.1, 0.9, 0.3]);
            assert_eq!(host(f(input.clone())), picture, "{draw:?}");
            let slopes = gradient(f, &input, &weights);
            assert!(
                slopes.iter().zip(&weights).all(|(s, w)| (s - w).abs() < 1e-5),
                "{draw:?}"
            );
        }
    }
}

#[test]
fn constant_pictures_stay_constant_and_keep_their_colour_where_it_is_not_what_changes() {
    let colour = [0.2, 0.5, 0.8];
    let picture: Vec<f32> = colour.iter().flat_map(|c| [*c; 21 * 34]).collect();
    let input = pictures(&picture, [1, 3, 21, 34]);
    for draw in strong() {
        let limit = match draw {
            Draw::Crop(_) | Draw::Scaling(_) | Draw::Rotation(_) | Draw::Blur(_) => 1e-5,
            Draw::EightBit => 0.5 / 255.0 + 1e-6,
            // Means are off by at most a sixteenth of their steps, 80 and 85; blue adds 1.772 times the second.
            Draw::Jpeg(_) => 14.5 / 255.0,
            _ => continue,
        };
        let found = host(apply(std::slice::from_ref(&draw), input.clone(), colour));
        let furthest = found
            .iter()
            .zip(&picture)
            .map(|(f, p)| (f - p).abs())
            .fold(0.0, f32::max);
        assert!(furthest < limit, "{draw:?} {furthest}");
    }
}

#[test]
fn batches_are_distorted_picture_by_picture_and_keep_their_order() {
    let (h, w) = (19, 26);
    // Two of each kind with others between.
    let draws: Vec<_> = strong().into_iter().chain([Draw::Clean]).chain(strong()).collect();
    let b = draws.len();
    let input = random_pictures([b, 3, h, w], 9);
    let weights = random(b * 3 * h * w, -1.0, 1.0, 2);
    let together = host(apply(&draws, input.clone(), GREY));
    let slopes = gradient(|x| apply(&draws, x, GREY), &input, &weights);
    for (i, draw) in draws.iter().enumerate() {
        let part = i * 3 * h * w..(i + 1) * 3 * h * w;
        let one = input.clone().slice(i..i + 1);
        let f = |x| apply(std::slice::from_ref(draw), x, GREY);
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(close(&together[part.clone()], &host(f(one.clone()))), "{draw:?}");
        assert!(
            close(&slopes[part.clone()], &gradient(f, &one, &weights[part])),
            "{draw:?}"
        );
    }
}

#[test]
fn brightness_contrast_and_masks_are_what_they_say() {
    // One pixel of three values, then four pixels.
    let found = |draw: Draw, values: &[f32], shape| host(apply(&[draw], pictures(values, shape), GREY));
    assert_eq!(
        found(Draw::Brightness(1.5), &[0.2, 0.5, 0.8], [1, 3, 1, 1]),
        [0.2 * 1.5, 0.75, 1.0]
    );
    // Grey of (0, 1, 0) and (1, 0, 1) is 0.587 and 0.4129, their mean 0.49995.
    let contrast = found(Draw::Contrast(0.5), &[0.0, 1.0, 1.0, 0.0, 0.0, 1.0], [1, 3, 1, 2]);
    for (value, expected) in contrast
        .iter()
        .zip([0.249_975, 0.749_975, 0.749_975, 0.249_975, 0.249_975, 0.749_975])
    {
        assert!((value - expected).abs() < 1e-5, "{contrast:?}");
    }
    let bar = Rectangle {
        at: [0.0, 1.0],
        height: 0.5,
        width: 0.5,
    };
    assert_eq!(
        found(Draw::Mask(vec![bar]), &[1.0; 12], [1, 3, 2, 2]),
        [1.0, 0.0, 1.0, 1.0].repeat(3)
    );
    let eight = found(Draw::EightBit, &[0.5, 0.25, 0.1], [1, 3, 1, 1]);
    for (value, expected) in eight.iter().zip([128.0, 64.0, 26.0]) {
        // 127.5 is rounded to the even 128, 63.75 to 64 and 25.5 (in single precision a little more) to 26.
        assert!((value * 255.0 - expected).abs() < 1e-3, "{value} {expected}");
    }
}

#[test]
fn noise_has_its_deviation() {
    let shape = [1, 3, 64, 64];
    let input = random_pictures(shape, 2);
    let found = host(apply(
        &[Draw::Noise(Noise { sigma: 0.03, seed: 11 })],
        input.clone(),
        GREY,
    ));
    let before = host(input);
    let n = before.len() as f64;
    let differences: Vec<f64> = found.iter().zip(&before).map(|(a, b)| f64::from(a - b)).collect();
    let mean = differences.iter().sum::<f64>() / n;
    let deviation = (differences.iter().map(|d| d * d).sum::<f64>() / n).sqrt();
    assert!(mean.abs() < 5.0 * 0.03 / n.sqrt(), "{mean}");
    assert!((deviation / 0.03 - 1.0).abs() < 0.03, "{deviation}");
}
