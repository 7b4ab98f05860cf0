//! Normal noise.
use image::RgbImage;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A normal number of standard deviation `sigma`, in units of [0, 1], added to each channel; clamped and rounded.
pub(super) fn add(mut picture: RgbImage, sigma: f32, random: &mut ChaCha8Rng) -> RgbImage {
    for value in picture.iter_mut() {
        let normal: f32 = StandardNormal.sample(random);
        // The cast clamps.
        *value = (f32::from(*value) + 255.0 * sigma * normal).round() as u8;
    }
    picture
}
