//! Where tests find real scenes, model weights and photographs.
use std::path::PathBuf;

pub use guardsplat_scene::testing::scene_path;

/// Path of model weights that are not part of the repository, as [`scene_path`].
pub fn model_path(name: &str) -> Option<PathBuf> {
    guardsplat_scene::testing::shared("GUARDSPLAT_MODELS", "models", name)
}
