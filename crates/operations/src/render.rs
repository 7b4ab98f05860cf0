//! Pictures of a scene, from where its viewers are or from given cameras.
use std::path::Path;

use guardsplat_engine::Result;
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::memory::{
    Limits, MemoryRequirements, SceneSize, admission, picture_bytes, rendering_requirements,
};
use guardsplat_engine::picture::Picture;
use guardsplat_engine::scene::{BadRows, Gaussians, Ignored, Scene};
use guardsplat_engine::splat::{Geometry, WeightCache, sh};
use guardsplat_engine::view::{Camera, SceneKind, Split, ViewSampler, Viewpoints};

/// Side of views where neither a size nor cameras say otherwise.
const DEFAULT_SIZE: u32 = 512;

/// What is to be rendered.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// How many views; of given cameras the first ones, all unless given. Without cameras one unless given.
    pub views: Option<u32>,
    /// Cameras, instead of ones where viewers of such a scene are.
    pub cameras: Option<Vec<Camera>>,
    /// The kind of scene, instead of the one that is found.
    pub kind: Option<SceneKind>,
    /// Side in pixels, 512 unless given; of given cameras their longer side, as it is unless given.
    pub size: Option<u32>,
    /// What is behind the scene.
    pub background: [f32; 3],
    /// Decides the views where no cameras are given.
    pub seed: u64,
    /// The level of detail of a streamed scene, 0 being the finest.
    pub level: usize,
    /// What becomes of rows with values that are not legal.
    pub bad_rows: BadRows,
    /// Where to compute.
    pub device: DeviceChoice,
    /// Bytes of memory that may be used, if not all of the machine's.
    pub memory: Option<u64>,
}

impl Rendering {
    /// The given cameras, as many and as large as asked for.
    fn given(&self) -> Option<Vec<Camera>> {
        let mut cameras = self.cameras.clone()?;
        cameras.truncate(self.views.unwrap_or(u32::MAX) as usize);
        if let Some(size) = self.size {
            cameras.iter_mut().for_each(|camera| resize(camera, size));
        }
        Some(cameras)
    }

    /// Memory of the largest picture and the program.
    fn besides(&self) -> MemoryRequirements {
        let size = self.size.unwrap_or(DEFAULT_SIZE);
        let pictures = match self.given() {
            Some(cameras) => cameras.iter().map(|c| picture_bytes(c.width, c.height)).max(),
            None => Some(picture_bytes(size, size)),
        };
        MemoryRequirements {
            pictures: pictures.unwrap_or(0),
            ..MemoryRequirements::of_program()
        }
    }
}

/// Renders views of a scene file; `each` is given every picture with its camera, index and the number of all.
///
/// # Errors
/// A scene that can't be read or does not fit, a failing device, and those of `each`.
pub fn render_file(
    path: &Path,
    rendering: &Rendering,
    each: impl FnMut(usize, usize, &Camera, Picture) -> Result<()>,
) -> Result<(Vec<Camera>, Option<Ignored>)> {
    let limits = Limits::of_machine(rendering.memory);
    let rest = rendering.besides();
    admission::admit_reading(path, &limits, rest)?;
    let scene = Scene::read_level(path, rendering.level, rendering.bad_rows, limits.left(&rest))?;
    let ignored = scene.ignored().cloned();
    limits.admit(&rendering_requirements(SceneSize::of(&scene), rest.pictures))?;
    let cameras = render(&scene.into_gaussians(), rendering, each)?;
    Ok((cameras, ignored))
}

/// Renders views of Gaussians in memory as [`render_file`] does, and tells the cameras.
///
/// # Errors
/// No Gaussians, a failing device, and those of `each`.
pub fn render(
    gaussians: &Gaussians,
    rendering: &Rendering,
    mut each: impl FnMut(usize, usize, &Camera, Picture) -> Result<()>,
) -> Result<Vec<Camera>> {
    let cameras = match rendering.given() {
        Some(cameras) => cameras,
        None => {
            let viewpoints = Viewpoints {
                kind: rendering.kind,
                cameras: &[],
            };
            let sampler = ViewSampler::seen_from(gaussians, rendering.seed, viewpoints)?;
            let size = rendering.size.unwrap_or(DEFAULT_SIZE);
            let views = 0..u64::from(rendering.views.unwrap_or(1));
            views.map(|index| sampler.camera(Split::HeldOut, index, size)).collect()
        }
    };
    let rasterizer = rasterizer(&open(rendering.device)?)?;
    let geometry = Geometry::new(gaussians);
    for (index, camera) in cameras.iter().enumerate() {
        let view = geometry.prepare(camera, WeightCache::None)?;
        let colours = sh::colours(&gaussians.sh, None, &view);
        let picture = rasterizer.render(&view, &colours, rendering.background)?;
        each(index, cameras.len(), camera, picture)?;
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
