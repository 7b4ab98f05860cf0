//! Where tests find real scenes.
use std::path::PathBuf;

/// Path of a real scene, or `None` (with a message) where they are absent. In CI their absence is a failure.
pub fn scene_path(name: &str) -> Option<PathBuf> {
    shared("GUARDSPLAT_SCENES", "scenes", name)
}

/// A file of a folder that is no part of the repository and that `variable` may name, as [`scene_path`].
pub fn shared(variable: &str, folder: &str, name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os(variable).map_or_else(
        || {
            PathBuf::from(env!("CARGO_MANIFEST_DIR"))
                .join("../../../shared")
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
