//! For tests: a tiny CLIP, and where real scenes and model weights are found.
pub mod tiny;

use std::path::PathBuf;

pub use guardsplat_scene::testing::scene_path;

/// Path of model weights that are not part of the repository, as [`scene_path`].
pub fn model_path(name: &str) -> Option<PathBuf> {
    guardsplat_scene::testing::shared("GUARDSPLAT_MODELS", "models", name)
}
