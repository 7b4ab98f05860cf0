//! `convert`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::memory::{Limits, MemoryRequirements, admission};
use guardsplat_engine::scene::convert::convert_to;
use guardsplat_engine::scene::{BadRows, Format, Scene};
use guardsplat_engine::{Error, Result};

use super::{Budget, Exit, print_line};

#[derive(Args)]
pub struct Arguments {
    /// The scene: PLY, compressed PLY, SPZ, SOG (also as a folder, and streamed), glTF, .ksplat or .splat
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write, of the format that its name says: .ply, .compressed.ply, .spz, .sog, .gltf, .glb, .ksplat or .splat
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// The level of detail of a SOG with a lod-meta.json; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    level: u32,
    /// Leaves out Gaussians with NaN and other impossible values instead of refusing the scene
    #[arg(long)]
    ignore_bad_rows: bool,
    #[command(flatten)]
    budget: Budget,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let (input, output) = (&arguments.input, &arguments.output);
    let format = Format::of_whole_name(output).ok_or_else(|| Error::BadOption {
        field: "OUT",
        reason: format!(
            "{} says no format: end it in one of {}",
            output.display(),
            Format::ALL.map(|format| format!(".{}", format.extension())).join(", ")
        ),
    })?;
    let limits = Limits::of_machine(arguments.budget.bytes());
    let rest = MemoryRequirements::of_program();
    admission::admit_reading(input, &limits, rest)?;
    let bad_rows = BadRows::ignored_if(arguments.ignore_bad_rows);
    let scene = Scene::read_level(input, arguments.level as usize, bad_rows, limits.left(&rest))?;
    if let Some(ignored) = scene.ignored() {
        eprintln!("note: {ignored}");
    }
    let from = scene.format();
    let gaussians = scene.into_gaussians();
    let written = convert_to(&gaussians, format, output)?;
    print_line(&format!(
        "{} Gaussians of degree {} as {} written to {}, {} of degree {}",
        gaussians.len(),
        gaussians.sh.degree,
        from.name(),
        output.display(),
        format.name(),
        written.degree
    ));
    Ok(Exit::Done)
}
