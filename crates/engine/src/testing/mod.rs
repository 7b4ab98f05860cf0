//! For tests: a tiny CLIP, a Vulkan device, and where real scenes and model weights are found.
pub mod tiny;

use std::path::PathBuf;

use crate::device::{Compute, DeviceChoice, open};

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
