//! Where tests find real scenes, and how they make ones of many files.
use crate::convert::convert;
use crate::{Error, Format, Gaussians, Result};
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

/// Writes a SOG that is streamed in levels of detail, the finest first, into a new folder as splat-transform would: each
/// level in `tiles` parts along x, a SOG a part, and an index. Where a level has nothing of a tile, it has no SOG of it.
///
/// # Errors
/// Those of [`convert`]; [`Error::Io`].
pub fn write_streamed_sog(folder: &Path, levels: &[Gaussians], tiles: usize) -> Result<()> {
    let failed = |error: io::Error| Error::io(folder)(error);
    let mut xs: Vec<f32> = levels.iter().flat_map(|l| &l.positions).map(|p| p[0]).collect();
    xs.sort_by(f32::total_cmp);
    let tile = |x: f32| xs.partition_point(|other| *other < x) * tiles / xs.len().max(1);
    let (mut names, mut leaves, mut counts) = (Vec::new(), vec![serde_json::Map::new(); tiles], Vec::new());
    std::fs::create_dir(folder).map_err(failed)?;
    for (level, gaussians) in levels.iter().enumerate() {
        counts.push(gaussians.len());
        for (index, leaf) in leaves.iter_mut().enumerate() {
            let others: Vec<usize> = (0..gaussians.len())
                .filter(|i| tile(gaussians.positions[*i][0]) != index)
                .collect();
            let part = crate::alter::without(gaussians, &others);
            if part.is_empty() {
                continue;
            }
            let name = format!("{level}_{index}");
            let mut bundle = Vec::new();
            convert(&part, Format::Sog, folder, &mut bundle)?;
            let mut zip = zip::ZipArchive::new(Cursor::new(bundle))
                .map_err(io::Error::other)
                .map_err(failed)?;
            zip.extract(folder.join(&name))
                .map_err(io::Error::other)
                .map_err(failed)?;
            let range = serde_json::json!({"file": names.len(), "offset": 0, "count": part.len()});
            leaf.insert(level.to_string(), range);
            names.push(format!("{name}/meta.json"));
        }
    }
    let children: Vec<_> = leaves
        .into_iter()
        .map(|lods| serde_json::json!({"lods": lods}))
        .collect();
    let index = serde_json::json!({
        "version": 1,
        "asset": {"generator": "guardsplat"},
        "count": counts.iter().sum::<usize>(),
        "counts": counts,
        "lodLevels": levels.len(),
        "filenames": names,
        "tree": {"children": children},
    });
    std::fs::write(folder.join("lod-meta.json"), index.to_string()).map_err(failed)
}

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
