//! Where tests find real scenes, model weights and photographs.
use std::path::PathBuf;

/// Path of a real scene, or `None` (with a message) where they are absent. In CI their absence is a failure.
pub fn scene_path(name: &str) -> Option<PathBuf> {
    shared("GUARDSPLAT_SCENES", "scenes", name)
}

/// Path of model weights that are not part of the repository, as [`scene_path`].
pub fn model_path(name: &str) -> Option<PathBuf> {
    shared("GUARDSPLAT_MODELS", "models", name)
}

fn shared(variable: &str, folder: &str, name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os(variable).map_or_else(
        || {
            PathBuf::from(env!("CARGO_MANIFEST_DIR"))
                .join("../../shared")
                .join(folder)
        },
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "{} is missing; set {variable}",
        path.display()
    );
    eprintln!(
        "skipped: {} is missing; set {variable} to run this test",
        path.display()
    );
    None
}
