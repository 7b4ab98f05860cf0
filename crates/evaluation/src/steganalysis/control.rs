//! What detectors must find: replaced least significant bits, the classical way to hide something.
//!
//! A detector that says nothing of marked pictures is only worth hearing if it speaks up here, on the same pictures.
use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The last bit of a share `rate` of the samples, 0 to 1, becomes a random one; the same `seed` gives the same picture.
/// Rates outside count as the nearest end.
pub fn replace_bits(picture: &RgbImage, rate: f64, seed: u64) -> RgbImage {
    let rate = if rate >= 0.0 { rate.min(1.0) } else { 0.0 };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut changed = picture.clone();
    for sample in changed.iter_mut() {
        if rng.random_bool(rate) {
            *sample = (*sample & !1) | u8::from(rng.random::<bool>());
        }
    }
    changed
}
