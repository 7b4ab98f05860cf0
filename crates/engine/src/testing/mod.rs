//! For tests: a tiny CLIP, a Vulkan device, where real scenes and model weights are found, and how far pictures differ.
pub mod tiny;

use std::path::PathBuf;

use crate::device::{Compute, DeviceChoice, open};
use crate::picture::Picture;

pub use guardsplat_scene::testing::scene_path;

/// The Vulkan device, or `None` with a message where there is none; in CI that is a failure.
///
/// # Panics
/// In CI, without one.
pub fn wgpu() -> Option<Compute> {
    match open(DeviceChoice::Wgpu) {
        Ok(compute) => Some(compute),
        Err(error) => {
            assert!(std::env::var_os("CI").is_none(), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// Path of model weights that are not part of the repository, as [`scene_path`].
pub fn model_path(name: &str) -> Option<PathBuf> {
    guardsplat_scene::testing::shared("GUARDSPLAT_MODELS", "models", name)
}

/// The largest difference between values of two pictures.
///
/// # Panics
/// If they are not of one size.
pub fn largest_difference(a: &Picture, b: &Picture) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let differences = a.pixels.iter().zip(&b.pixels).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f32::max)
}
