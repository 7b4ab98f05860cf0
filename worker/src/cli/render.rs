//! `render`.
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::quality::write_picture;
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::view::{read_cameras, write_cameras};
use guardsplat_engine::{Error, Result};
use guardsplat_operations::render::{Rendering, render_file};

use super::display::Display;
use super::{Background, Budget, Exit, Kind, print_line};

/// Where the cameras are written, in the folder of the pictures.
const CAMERAS: &str = "cameras.json";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// 8 bits a channel
    Png,
    /// 32-bit float, values as rendered
    Exr,
}

#[derive(Args)]
pub struct Arguments {
    /// The scene: PLY, compressed PLY, SPZ, SOG (also as a folder, and streamed), glTF, .ksplat or .splat
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// A folder for the pictures and their cameras
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// How many views; with --cameras, its first ones, all unless given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000), required_unless_present = "cameras")]
    views: Option<u32>,
    /// Cameras from a file (cameras.json, transforms.json or a glTF) or a folder of COLMAP instead of ones where viewers of such a scene are
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<Kind>,
    /// Side in pixels, 512 unless given; for cameras from a file, their longer side, as in the file unless given
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(1..=8192))]
    size: Option<u32>,
    /// What is behind the scene
    #[arg(long, value_enum, default_value = "white")]
    background: Background,
    /// Format of the pictures
    #[arg(long, value_enum, default_value = "png")]
    format: Format,
    /// Decides the views. No embedding uses any of them, whatever its seed
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The level of detail of a SOG with a lod-meta.json; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    level: u32,
    /// Leaves out Gaussians with NaN and other impossible values instead of refusing the scene
    #[arg(long)]
    ignore_bad_rows: bool,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let rendering = Rendering {
        views: arguments.views,
        cameras: arguments.cameras.as_deref().map(read_cameras).transpose()?,
        kind: arguments.kind.map(Kind::scene),
        size: arguments.size,
        background: arguments.background.rgb(),
        seed: arguments.seed,
        level: arguments.level as usize,
        bad_rows: BadRows::ignored_if(arguments.ignore_bad_rows),
        device: arguments.device,
        memory: arguments.budget.bytes(),
    };
    let folder = &arguments.folder;
    let extension = match arguments.format {
        Format::Png => "png",
        Format::Exr => "exr",
    };
    let mut display = Display::new("rendering");
    let (cameras, ignored) = render_file(&arguments.input, &rendering, |index, total, _, picture| {
        if index == 0 {
            std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        }
        write_picture(&folder.join(format!("view_{index:03}.{extension}")), &picture)?;
        display.set(index + 1, total, String::new);
        Ok(())
    })?;
    write_cameras(&folder.join(CAMERAS), &cameras)?;
    drop(display);
    print_line(&format!(
        "{} views and {CAMERAS} written to {}",
        cameras.len(),
        folder.display()
    ));
    if let Some(ignored) = ignored {
        print_line(&ignored.to_string());
    }
    Ok(Exit::Done)
}
