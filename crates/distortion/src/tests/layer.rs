//! What layers draw, and what they say when something is wrong.
use burn::tensor::Tensor;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{GREY, apply, strong};
use crate::testing::*;
use crate::*;

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
    let pictures = DistortionKind::ALL.into_iter().filter(|k| !k.acts_on_scene());
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
            Some(DistortionKind::Rotation | DistortionKind::Mask) => assert_ne!(*before, after),
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
