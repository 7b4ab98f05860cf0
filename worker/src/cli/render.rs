//! `render`.
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::memory::{
    Limits, MemoryRequirements, SceneSize, admission, picture_bytes, rendering_requirements,
};
use guardsplat_engine::quality::write_picture;
use guardsplat_engine::scene::{BadRows, Scene};
use guardsplat_engine::splat::{Geometry, WeightCache, sh};
use guardsplat_engine::view::{Camera, Split, ViewSampler, Viewpoints, read_cameras, write_cameras};
use guardsplat_engine::{Error, Result};

use super::display::Display;
use super::{Background, Budget, Exit, Kind, print_line};

/// Side of views where neither a size nor a camera file says otherwise.
const DEFAULT_SIZE: u32 = 512;
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
    /// The scene: PLY, compressed PLY, SPZ, SOG (also as a folder), glTF or .splat
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// A folder for the pictures and their cameras
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// How many views; with --cameras, its first ones, all unless given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000), required_unless_present = "cameras")]
    views: Option<u32>,
    /// Cameras from a file (cameras.json or transforms.json) or a folder of COLMAP instead of ones where viewers of such a scene are
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
    let size = arguments.size.unwrap_or(DEFAULT_SIZE);
    let given = arguments.cameras.as_ref().map(|path| from_file(path, arguments));
    let given: Option<Vec<Camera>> = given.transpose()?;
    let pictures = match &given {
        Some(cameras) => cameras.iter().map(|c| picture_bytes(c.width, c.height)).max(),
        None => Some(picture_bytes(size, size)),
    };
    let rest = MemoryRequirements {
        pictures: pictures.unwrap_or(0),
        ..MemoryRequirements::of_program()
    };
    let limits = Limits::of_machine(arguments.budget.bytes());
    admission::admit_reading(&arguments.input, &limits, rest)?;
    let bad_rows = BadRows::ignored_if(arguments.ignore_bad_rows);
    let scene = Scene::read_with_files(&arguments.input, bad_rows, limits.left(&rest))?;
    let ignored = scene.ignored().cloned();
    limits.admit(&rendering_requirements(SceneSize::of(&scene), rest.pictures))?;
    let scene = scene.into_gaussians();
    let cameras = match given {
        Some(cameras) => cameras,
        None => {
            let viewpoints = Viewpoints {
                kind: arguments.kind.map(Kind::scene),
                cameras: &[],
            };
            let sampler = ViewSampler::seen_from(&scene, arguments.seed, viewpoints)?;
            let views = 0..u64::from(arguments.views.unwrap_or(1));
            views.map(|index| sampler.camera(Split::HeldOut, index, size)).collect()
        }
    };
    let rasterizer = rasterizer(&open(arguments.device)?)?;
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let extension = match arguments.format {
        Format::Png => "png",
        Format::Exr => "exr",
    };
    let mut display = Display::new("rendering");
    let geometry = Geometry::new(&scene);
    for (index, camera) in cameras.iter().enumerate() {
        let view = geometry.prepare(camera, WeightCache::None)?;
        let colours = sh::colours(&scene.sh, None, &view);
        let picture = rasterizer.render(&view, &colours, arguments.background.rgb())?;
        write_picture(&folder.join(format!("view_{index:03}.{extension}")), &picture)?;
        display.set(index + 1, cameras.len(), String::new);
    }
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

/// The cameras of a file, as many and as large as asked for.
fn from_file(path: &Path, arguments: &Arguments) -> Result<Vec<Camera>> {
    let mut cameras = read_cameras(path)?;
    cameras.truncate(arguments.views.unwrap_or(u32::MAX) as usize);
    if let Some(size) = arguments.size {
        cameras.iter_mut().for_each(|camera| resize(camera, size));
    }
    Ok(cameras)
}

/// Scales a camera so that its longer side has `size` pixels.
fn resize(camera: &mut Camera, size: u32) {
    let scale = size as f32 / camera.width.max(camera.height).max(1) as f32;
    let side = |pixels: u32| ((pixels as f32 * scale).round() as u32).max(1);
    camera.width = side(camera.width);
    camera.height = side(camera.height);
    for length in [&mut camera.fx, &mut camera.fy, &mut camera.cx, &mut camera.cy] {
        *length *= scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resized_cameras_see_the_same() {
        let look = |width, height| Camera::look_at([0.0, 0.0, -3.0], [0.0; 3], [0.0, -1.0, 0.0], 0.8, width, height);
        let mut camera = look(800, 600);
        resize(&mut camera, 400);
        assert_eq!((camera.width, camera.height), (400, 300));
        let expected = look(400, 300);
        assert!((camera.fx - expected.fx).abs() < 1e-3 && (camera.cy - 150.0).abs() < 1e-3);
    }
}
