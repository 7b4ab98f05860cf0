//! What holds for every distortion, alone and in mixed batches.
use burn::tensor::Tensor;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

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
                let inside = |v: &f32| (-1e-6..=1.0 + 1e-6).contains(v);
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
            // The steps of the means at quality 10 are 80 and 85, an eighth of which is at most 10.6: half of it
            // times 1.772 is off.
            Draw::Jpeg(_) => 10.0 / 255.0,
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

#[test]
fn draws_are_uniform_seeded_and_independent_of_other_ranges() {
    let layer = Layer {
        robust_to: RobustTo::all(),
        ..Layer::default()
    };
    layer.check().unwrap();
    let draw = |layer: &Layer, seed| layer.draw(6000, &mut ChaCha8Rng::seed_from_u64(seed));
    let draws = draw(&layer, 1);
    assert_eq!(draws, draw(&layer, 1));
    assert_ne!(draws, draw(&layer, 2));
    // Clean and the eleven that act on pictures: 500 of each, with a deviation of 21.4.
    let pictures = Kind::ALL.into_iter().filter(|k| !k.acts_on_scene());
    for kind in pictures.map(Some).chain([None]) {
        let count = draws.iter().filter(|d| d.kind() == kind).count();
        assert!(count.abs_diff(500) < 100, "{kind:?} {count}");
    }
    for one in &draws {
        one.check().unwrap();
        if let Draw::Mask(rectangles) = one {
            let area: f32 = rectangles.iter().map(|r| r.height * r.width).sum();
            assert!(area <= 0.2 + 1e-6 && !rectangles.is_empty() && rectangles.len() <= MAX_RECTANGLES);
        }
    }
    let mut changed = layer.clone();
    changed.ranges.rotation = [0.0, 1.0];
    changed.ranges.mask = [0.0, 0.0];
    for (before, after) in draws.iter().zip(draw(&changed, 1)) {
        match before.kind() {
            Some(Kind::Rotation | Kind::Mask) => assert_ne!(*before, after),
            _ => assert_eq!(*before, after),
        }
    }
    // The two numbers a picture are the same with another list, so that the generator is where it was.
    let (mut a, mut b) = (ChaCha8Rng::seed_from_u64(3), ChaCha8Rng::seed_from_u64(3));
    layer.draw(7, &mut a);
    Layer::default().draw(7, &mut b);
    assert_eq!(a, b);
}

#[test]
fn masks_cover_no_more_than_their_share() {
    let layer = Layer {
        robust_to: "mask".parse().unwrap(),
        ..Layer::default()
    };
    let draws = layer.draw(64, &mut ChaCha8Rng::seed_from_u64(5));
    let (h, w) = (33, 47);
    let found = host(apply(&draws, pictures(&vec![1.0; 64 * 3 * h * w], [64, 3, h, w]), GREY));
    let covered: Vec<usize> = found
        .chunks_exact(3 * h * w)
        .map(|picture| picture[..h * w].iter().filter(|v| **v == 0.0).count())
        .collect();
    assert!(covered.iter().all(|count| *count as f64 <= 0.2 * (h * w) as f64));
    assert!(covered.iter().any(|count| *count as f64 > 0.1 * (h * w) as f64));
}

#[test]
fn layers_apply_what_they_draw_and_are_stored() {
    let layer: Layer = serde_json::from_str(r#"{"robust_to": ["jpeg", "crop"]}"#).unwrap();
    let text = serde_json::to_string(&layer).unwrap();
    assert_eq!(serde_json::from_str::<Layer>(&text).unwrap(), layer);
    assert!(serde_json::from_str::<Layer>(r#"{"robust": []}"#).is_err());
    let input = random_pictures([6, 3, 20, 20], 3);
    let rng = || ChaCha8Rng::seed_from_u64(4);
    let draws = layer.draw(6, &mut rng());
    let found = host(layer.apply(input.clone(), GREY, &mut rng()));
    assert_eq!(found, host(layer.apply_with(&draws, input.clone(), GREY).unwrap()));
    assert_eq!(found, host(layer.apply(input.clone(), GREY, &mut rng())));
    assert_ne!(found, host(input.clone()));
    assert_eq!(
        host(Layer::default().apply(input.clone(), GREY, &mut rng())),
        host(input)
    );
    for one in strong() {
        let text = serde_json::to_string(&one).unwrap();
        assert_eq!(serde_json::from_str::<Draw>(&text).unwrap(), one, "{text}");
    }
}

#[test]
fn errors_say_what_is_wrong() {
    let error = |draws: &[Draw], shape: [usize; 4]| {
        let input = Tensor::<4>::zeros(shape, &burn::tensor::Device::flex());
        let found = Layer::default().apply_with(draws, input, GREY);
        found.err().unwrap().to_string()
    };
    let one = [1, 3, 4, 4];
    assert_eq!(error(&[], one), "0 draws for 1 pictures, there must be one for each");
    assert_eq!(
        error(&[Draw::Clean], [1, 1, 4, 4]),
        "pictures have shape [1, 1, 4, 4], must be [b, 3, h, w] with h and w at least 1"
    );
    assert_eq!(
        error(&[Draw::Scaling(0.01)], one),
        "scaling is 0.01, must be within 0.05 and 4"
    );
    assert!(error(&[Draw::Rotation(f32::NAN)], one).starts_with("rotation is NaN"));
    let five = vec![
        Rectangle {
            at: [0.0; 2],
            height: 0.1,
            width: 0.1
        };
        5
    ];
    assert_eq!(
        error(&[Draw::Mask(five)], one),
        "number of rectangles is 5, must be within 0 and 4"
    );
}
