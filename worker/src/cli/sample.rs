//! `sample`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::scene::Format;
use guardsplat_engine::scene::convert::convert_to;
use guardsplat_engine::view::write_cameras;
use guardsplat_engine::{Error, Result, sample};

use super::{Exit, Kind, print_line};

/// Cameras of a scene that is not seen from all around.
const CAMERAS: usize = 40;

#[derive(Args)]
pub struct Arguments {
    /// The scene file to write, of the format that its name says: .ply, .compressed.ply, .spz, .sog, .gltf, .glb or .splat
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// What it is of: things on a disc, a room with things in it, hills with houses, or a stage that was captured from its
    /// front
    #[arg(long, value_enum, default_value = "object")]
    kind: Kind,
    /// Writes where the viewers of a room, of terrain or of a stage are to this file, cameras.json, for `embed --cameras`
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// How many Gaussians
    #[arg(long, default_value_t = 30_000)]
    gaussians: usize,
    /// Degree of its spherical harmonics, 0 to 4
    #[arg(long, default_value_t = 3)]
    sh_degree: usize,
    /// Decides shapes and textures
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let kind = arguments.kind.scene();
    let cameras = sample::cameras(kind, CAMERAS);
    if arguments.cameras.is_some() && cameras.is_empty() {
        return Err(Error::BadOption {
            field: "--cameras",
            reason: "an object is seen from all around; say --kind room, terrain or forward".into(),
        });
    }
    let scene = sample::sample_of(kind, arguments.gaussians, arguments.sh_degree, arguments.seed)?;
    if let Some(file) = &arguments.cameras {
        write_cameras(file, &cameras)?;
    }
    // The format that the name says, and PLY for names that say none.
    let format = Format::of_whole_name(&arguments.output).unwrap_or(Format::Ply);
    convert_to(&scene.gaussians, format, &arguments.output)?;
    print_line(&format!(
        "{} Gaussians of degree {} written to {}",
        scene.gaussians.len(),
        arguments.sh_degree,
        arguments.output.display()
    ));
    Ok(Exit::Done)
}
