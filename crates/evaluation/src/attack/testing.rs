//! Where tests find real photographs, and how far two pictures are apart.
use std::path::PathBuf;

use image::RgbImage;

/// A real photograph, or `None` (with a message) where it is absent. In CI its absence is a failure.
pub fn photo(name: &str) -> Option<RgbImage> {
    let folder = std::env::var_os("GUARDSPLAT_IMAGES").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/images/photos"),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(image::open(&path).expect("photographs can be read").into_rgb8());
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "{} is missing; set GUARDSPLAT_IMAGES",
        path.display()
    );
    eprintln!(
        "skipped: {} is missing; set GUARDSPLAT_IMAGES to run this test",
        path.display()
    );
    None
}

/// Peak signal-to-noise ratio in dB over all channels, infinite for equal pictures, `None` for different sizes.
pub fn psnr(one: &RgbImage, other: &RgbImage) -> Option<f64> {
    if one.dimensions() != other.dimensions() {
        return None;
    }
    let squares = one.iter().zip(other.iter());
    let sum: f64 = squares.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    Some(-10.0 * (sum / one.len() as f64 / 255.0f64.powi(2)).log10())
}
