//! What tests share: pictures, values on the host, and checks of gradients.
use std::path::PathBuf;

use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub fn host<const D: usize>(x: Tensor<D>) -> Vec<f32> {
    x.try_into_vec_as::<f32>().unwrap()
}

/// Random values within `low` and `high`, from a fixed seed.
pub fn random(count: usize, low: f32, high: f32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| low + (high - low) * rng.random::<f32>()).collect()
}

pub fn pictures(values: &[f32], shape: [usize; 4]) -> Tensor<4> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), &Device::flex())
}

/// `b` random pictures, away from the ends of the range.
pub fn random_pictures(shape: [usize; 4], seed: u64) -> Tensor<4> {
    pictures(&random(shape.iter().product(), 0.2, 0.8, seed), shape)
}

/// The pictures with a gradient to come.
pub fn tracked(pictures: &Tensor<4>) -> Tensor<4> {
    pictures.clone().autodiff().require_grad()
}

/// Gradient of the sum of `weights` times what `f` makes of `pictures`.
pub fn gradient(f: impl Fn(Tensor<4>) -> Tensor<4>, pictures: &Tensor<4>, weights: &[f32]) -> Vec<f32> {
    let x = tracked(pictures);
    let y = f(x.clone());
    let weights = Tensor::<4>::from_data(TensorData::new(weights.to_vec(), y.dims()), &y.device());
    let gradients = (y * weights).sum().backward();
    host(x.grad(&gradients).unwrap())
}

/// Compares the gradient of a function that is smooth around `pictures` with central differences, in 24 values.
pub fn check_gradient(f: impl Fn(Tensor<4>) -> Tensor<4>, pictures_in: &Tensor<4>, step: f32, tolerance: f64) {
    let shape = pictures_in.dims();
    let values = host(pictures_in.clone());
    let weights = random(values.len(), -1.0, 1.0, 99);
    let found = gradient(&f, pictures_in, &weights);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut largest = 0.0_f64;
    for _ in 0..24 {
        let at = rng.random_range(0..values.len());
        let moved = |by: f32| {
            let mut values = values.clone();
            values[at] += by;
            host(f(pictures(&values, shape)))
        };
        let (up, down) = (moved(step), moved(-step));
        let pairs = up.iter().zip(&down).zip(&weights);
        let change: f64 = pairs
            .map(|((u, d), w)| (f64::from(*u) - f64::from(*d)) * f64::from(*w))
            .sum();
        let slope = change / (2.0 * f64::from(step));
        let difference = (f64::from(found[at]) - slope).abs();
        assert!(
            difference < tolerance * (1.0 + slope.abs()),
            "{at}: {} {slope}",
            found[at]
        );
        largest = largest.max(slope.abs());
    }
    assert!(largest > 1e-3, "gradient is nowhere");
}

pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares = a.iter().zip(b).map(|(x, y)| f64::from(x - y).powi(2));
    -10.0 * (squares.sum::<f64>() / a.len() as f64).log10()
}

/// Path of a real photograph, or `None` (with a message) where they are absent. In CI their absence is a failure.
pub fn photo_path(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("GUARDSPLAT_IMAGES").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/images/photos"),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    let missing = format!("{} is missing; set GUARDSPLAT_IMAGES", path.display());
    assert!(std::env::var_os("CI").is_none(), "{missing}");
    eprintln!("skipped: {missing} to run this test");
    None
}
