//! `cameras`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::Result;
use guardsplat_engine::view::{read_cameras, write_cameras};

use super::{Exit, print_line};

#[derive(Args)]
pub struct Arguments {
    /// Cameras: cameras.json (3DGS), transforms.json (NeRF), a glTF (.gltf or .glb), or a folder of COLMAP with cameras and images (.bin or .txt)
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write: transforms.json where its name has `transforms` in it, else cameras.json
    #[arg(value_name = "OUT")]
    output: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let cameras = read_cameras(&arguments.input)?;
    write_cameras(&arguments.output, &cameras)?;
    print_line(&format!(
        "{} cameras written to {}",
        cameras.len(),
        arguments.output.display()
    ));
    Ok(Exit::Done)
}
