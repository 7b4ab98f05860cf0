//! Sample scenes as files, with the cameras of their viewers.
use std::path::{Path, PathBuf};

use guardsplat_engine::scene::Format;
use guardsplat_engine::scene::convert::convert_to;
use guardsplat_engine::view::{SceneKind, write_cameras};
use guardsplat_engine::{Error, Result, sample};

/// Cameras of a scene that is not seen from all around.
const CAMERAS: usize = 40;

/// What the sample is to be.
#[derive(Clone, Debug)]
pub struct Sample {
    /// What it is of.
    pub kind: SceneKind,
    /// How many Gaussians.
    pub gaussians: usize,
    /// Degree of its spherical harmonics.
    pub sh_degree: usize,
    /// Decides shapes and textures.
    pub seed: u64,
    /// The file to write cameras to.
    pub cameras: Option<PathBuf>,
}

/// Writes a sample, in the format that the name says and as PLY where it says none.
///
/// # Errors
/// Those of [`sample::sample_of`] and of writing; cameras of an object.
pub fn write(path: &Path, wanted: &Sample) -> Result<()> {
    let cameras = sample::cameras(wanted.kind, CAMERAS);
    if wanted.cameras.is_some() && cameras.is_empty() {
        return Err(Error::BadOption {
            field: "--cameras",
            reason: "an object is seen from all around; say --kind room, terrain or forward".into(),
        });
    }
    let scene = sample::sample_of(wanted.kind, wanted.gaussians, wanted.sh_degree, wanted.seed)?;
    if let Some(file) = &wanted.cameras {
        write_cameras(file, &cameras)?;
    }
    let format = Format::of_whole_name(path).unwrap_or(Format::Ply);
    convert_to(&scene.gaussians, format, path)?;
    Ok(())
}
