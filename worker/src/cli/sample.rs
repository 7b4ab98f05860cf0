//! `sample`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::Result;
use guardsplat_engine::sample::sample;

use super::{Exit, print_line};

#[derive(Args)]
pub struct Arguments {
    /// The scene file to write
    #[arg(value_name = "OUT")]
    output: PathBuf,
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
    let scene = sample(arguments.gaussians, arguments.sh_degree, arguments.seed)?;
    scene.write(&arguments.output, &scene.gaussians.sh)?;
    print_line(&format!(
        "{} Gaussians of degree {} written to {}",
        scene.gaussians.len(),
        arguments.sh_degree,
        arguments.output.display()
    ));
    Ok(Exit::Done)
}
