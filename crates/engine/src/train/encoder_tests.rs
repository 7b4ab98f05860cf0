//! The image encoder with the filters that training gives it.
use burn::tensor::{Device, Tensor, TensorData};

use super::filters::{LUMA, NORM, filters};
use crate::clip::{ClipConfig, ClipModel, ImageTower, Parts, RandomFourierEncoder, preprocess};

const SIZE: usize = 64;

fn config() -> ClipConfig {
    let mut config = super::config(&super::TrainOptions::default());
    config.vision.image_size = SIZE;
    config.vision.width = 8;
    config.embed_dim = 6;
    config
}

fn tower() -> RandomFourierEncoder {
    match ClipModel::init(&config(), Parts::Image, &Device::flex(), 3).visual {
        Some(ImageTower::RandomFourier(tower)) => tower,
        other => panic!("{other:?}"),
    }
}

fn picture(value: impl Fn(usize) -> f32) -> Tensor<4> {
    let values: Vec<f32> = (0..3 * SIZE * SIZE).map(value).collect();
    Tensor::from_data(TensorData::new(values, [1, 3, SIZE, SIZE]), &Device::flex())
}

fn values(tensor: Tensor<2>) -> Vec<f32> {
    tensor.try_to_vec_as::<f32>().unwrap()
}

/// A tower with filters as the shipped model has them.
fn shipped_filters() -> RandomFourierEncoder {
    let (weights, phases) = filters(8 * 3, NORM, LUMA, 1);
    tower().with_filters(&weights, &phases)
}

#[test]
fn flat_pictures_read_alike_at_every_scale_place_and_size() {
    for level in [-2.0, 0.0, 0.7] {
        let tower = shipped_filters();
        let averages = values(tower.statistics(&picture(|_| level)));
        let small = Tensor::<4>::full([1, 3, 16, 16], level, &Device::flex());
        for (a, b) in averages.iter().zip(values(tower.statistics(&small))) {
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
    }
}

#[test]
fn grounds_of_black_and_white_have_no_response() {
    let normalization = config().normalization;
    for level in [0.0, 1.0] {
        let ground = Tensor::<4>::full([1, 3, SIZE, SIZE], level, &Device::flex());
        let input = preprocess(ground, SIZE, &normalization);
        let response = values(shipped_filters().statistics(&input));
        assert!(response.iter().all(|v| v.abs() < 1e-4), "{level}: {response:?}");
    }
}

#[test]
fn averages_do_not_depend_on_the_place() {
    // The same blob in two places, aligned to the coarsest scale.
    let blob = |x0: usize, y0: usize| {
        picture(move |i| {
            let (x, y) = (i % SIZE, i / SIZE % SIZE);
            let inside = (x0..x0 + 8).contains(&x) && (y0..y0 + 8).contains(&y);
            if inside {
                ((x - x0) as f32 - 3.5) * 0.2 + (y - y0) as f32 * 0.05
            } else {
                0.0
            }
        })
    };
    let averages = |at| values(shipped_filters().statistics(&at));
    let (a, b, elsewhere) = (
        averages(blob(24, 28)),
        averages(blob(32, 24)),
        averages(picture(|i| (i as f32).sin())),
    );
    let gap = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(gap(&a, &b) < 1e-4, "{}", gap(&a, &b));
    assert!(gap(&a, &elsewhere) > 1e-2);
}

#[test]
fn configuration_survives_writing() {
    let text = config().to_open_clip().unwrap();
    assert_eq!(ClipConfig::parse("test", &text).unwrap(), config());
    let broken = text.replace("\"kernel\": 1", "\"kernel\": 3");
    assert!(
        ClipConfig::parse("test", &broken)
            .unwrap_err()
            .to_string()
            .contains("kernel")
    );
}
