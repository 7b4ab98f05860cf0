//! `sample`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::Result;
use guardsplat_operations::sample::{self, Sample};

use super::{Exit, Kind, print_line};

#[derive(Args)]
pub struct Arguments {
    /// The scene file to write, of the format that its name says: .ply, .compressed.ply, .spz, .sog, .gltf, .glb, .ksplat or .splat
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
    let wanted = Sample {
        kind: arguments.kind.scene(),
        gaussians: arguments.gaussians,
        sh_degree: arguments.sh_degree,
        seed: arguments.seed,
        cameras: arguments.cameras.clone(),
    };
    sample::write(&arguments.output, &wanted)?;
    print_line(&format!(
        "{} Gaussians of degree {} written to {}",
        arguments.gaussians,
        arguments.sh_degree,
        arguments.output.display()
    ));
    Ok(Exit::Done)
}
