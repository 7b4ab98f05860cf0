//! `sample`.
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use guardsplat_engine::scene::Format;
use guardsplat_engine::scene::convert::convert_to;
use guardsplat_engine::view::write_cameras;
use guardsplat_engine::{Error, Result, sample};

use super::{Exit, print_line};

/// Cameras of a room.
const CAMERAS: usize = 40;

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Things on a disc of ground
    Object,
    /// A room with things in it
    Room,
}

#[derive(Args)]
pub struct Arguments {
    /// The scene file to write, of the format that its name says: .ply, .compressed.ply, .spz, .sog, .gltf, .glb or .splat
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// What it is of: object (seen from outside) or room (seen from inside)
    #[arg(long, value_enum, default_value = "object")]
    kind: Kind,
    /// Writes cameras inside the room to this file, cameras.json, for `embed --cameras`
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
    let kind = match arguments.kind {
        Kind::Object => sample::Kind::Object,
        Kind::Room => sample::Kind::Room,
    };
    let cameras = sample::cameras(kind, CAMERAS);
    if arguments.cameras.is_some() && cameras.is_empty() {
        return Err(Error::BadOption {
            field: "--cameras",
            reason: "an object is seen from all around; say --kind room".into(),
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
