//! Views where a scene's viewers are: at, around and between cameras that were given, such as those that it was captured
//! with. A room is seen from inside, and a street from the street.
//!
//! **Split.** Every eighth camera is held out, as scenes are evaluated since Mip-NeRF 360; training views keep away from
//! those, by their place or their direction. With fewer than eight cameras the last one is.
//!
//! **Training views.** Half of them are at a camera, and half at a random place between it and the nearest other one. Place,
//! direction and field of view are moved a little, but never nearer to what is there than cameras are that were given.
use rand::{Rng, RngExt};

use super::camera::Camera;
use super::vector::{along, cross, dot, sub, unit};
use crate::error::{Error, Result};
use crate::scene::Gaussians;

/// One camera in so many is held out.
const HELD_OUT: usize = 8;
/// How far training views move from a camera, in distances to the nearest other one.
const MOVED: f32 = 0.25;
/// How far they turn, radians: 6 degrees.
const TURNED: f32 = 0.1;
/// Their fields of view, in that of their camera.
const ZOOMED: std::ops::Range<f32> = 0.85..1.2;
/// A training view is not at a held-out camera: farther from its place than this share of a distance, or turned away from
/// it by [`TURNED`].
const APART: f32 = 0.1;
/// Gaussians that are at least so opaque are in the way.
const OPAQUE: f32 = 0.5;
/// Training views come as near to what is in the way as this share of the least distance of a camera.
const NEAREST: f32 = 0.5;
/// How often a view is drawn anew before its camera is taken as it is.
const TRIES: usize = 16;

/// Cameras that were given, and what is needed to draw views around them.
#[derive(Clone, Debug)]
pub struct GivenViews {
    training: Vec<Camera>,
    held_out: Vec<Camera>,
    /// Of each training camera, the nearest other one, and how far it is.
    nearest: Vec<(usize, f32)>,
    /// Centres of Gaussians that may be in the way, and how near a view may come.
    solid: Vec<[f32; 3]>,
    clearance: f32,
}

impl GivenViews {
    /// Views of a scene around `cameras`.
    ///
    /// # Errors
    /// [`Error::BadOption`] for fewer than two cameras.
    pub fn new(gaussians: &Gaussians, cameras: &[Camera]) -> Result<Self> {
        if cameras.len() < 2 {
            return Err(Error::BadOption {
                field: "cameras",
                reason: format!("{} is too few, at least 2 are needed: one is held out", cameras.len()),
            });
        }
        let last = cameras.len() - 1;
        let (mut training, mut held_out) = (Vec::new(), Vec::new());
        for (i, camera) in cameras.iter().enumerate() {
            let held = match cameras.len() < HELD_OUT {
                true => i == last,
                false => i % HELD_OUT == 0,
            };
            if held { &mut held_out } else { &mut training }.push(camera.clone());
        }
        let nearest = (0..training.len()).map(|i| nearest(&training, i)).collect();
        let solid: Vec<[f32; 3]> = (gaussians.positions.iter().zip(&gaussians.opacity_logits))
            .filter(|(_, logit)| 1.0 / (1.0 + (-**logit).exp()) >= OPAQUE)
            .map(|(position, _)| *position)
            .collect();
        let mut given = Self {
            training,
            held_out,
            nearest,
            solid,
            clearance: 0.0,
        };
        let least = cameras.iter().map(|camera| given.distance_to_solid(camera.centre()));
        given.clearance = NEAREST * least.fold(f32::INFINITY, f32::min);
        Ok(given)
    }

    /// Cameras that training views are around.
    pub fn training_cameras(&self) -> usize {
        self.training.len()
    }

    /// Cameras that are held out.
    pub fn held_out_cameras(&self) -> usize {
        self.held_out.len()
    }

    /// How near a training view comes to the centre of an opaque Gaussian at least; infinity where there is none.
    pub fn clearance(&self) -> f32 {
        self.clearance
    }

    /// A training view, `size` by `size` pixels.
    pub(super) fn training(&self, index: u64, size: u32, random: &mut impl Rng) -> Camera {
        let own = (index % self.training.len() as u64) as usize;
        let camera = &self.training[own];
        for _ in 0..TRIES {
            let view = self.around(own, size, random);
            if self.is_apart(&view) && self.distance_to_solid(view.centre()) >= self.clearance {
                return view;
            }
        }
        square(camera, size, 1.0)
    }

    /// A held-out view: a held-out camera as it is, with the field of view of its picture's middle.
    pub(super) fn held_out(&self, index: u64, size: u32) -> Camera {
        square(&self.held_out[(index % self.held_out.len() as u64) as usize], size, 1.0)
    }

    fn around(&self, own: usize, size: u32, random: &mut impl Rng) -> Camera {
        let camera = &self.training[own];
        let (other, distance) = self.nearest[own];
        let between = if random.random::<bool>() {
            random.random::<f32>()
        } else {
            0.0
        };
        let step: [f32; 3] = std::array::from_fn(|_| MOVED * distance * random.random_range(-1.0..1.0));
        let other = &self.training[other];
        let eye = along(camera.centre(), between, sub(other.centre(), camera.centre()));
        let eye = along(eye, 1.0, step);
        let turn: [f32; 3] = std::array::from_fn(|_| TURNED * random.random_range(-1.0..1.0));
        let mix = |row: usize| {
            let way = sub(other.rotation[row], camera.rotation[row]);
            along(camera.rotation[row], between, way)
        };
        // Opposite directions have no mean; then the camera's own is as good.
        let forward = unit(along(mix(2), 1.0, turn)).unwrap_or(camera.rotation[2]);
        let down = mix(1);
        let right = unit(cross(down, forward)).unwrap_or(camera.rotation[0]);
        let rotation = [right, cross(forward, right), forward];
        let mut view = square(camera, size, random.random_range(ZOOMED));
        view.rotation = rotation;
        view.translation = rotation.map(|row| -dot(row, eye));
        view
    }

    /// Whether a view is none of those that are held out.
    fn is_apart(&self, view: &Camera) -> bool {
        let spacing = self
            .nearest
            .iter()
            .map(|(_, distance)| *distance)
            .fold(f32::INFINITY, f32::min);
        self.held_out.iter().all(|held| {
            let way = sub(view.centre(), held.centre());
            // Where all cameras are at one place none is far, and only their directions tell them apart.
            let far = dot(way, way).sqrt() > APART * spacing;
            far || dot(view.rotation[2], held.rotation[2]) <= TURNED.cos()
        })
    }

    /// From a place to the centre of the nearest Gaussian that is in the way; infinity where none is.
    fn distance_to_solid(&self, place: [f32; 3]) -> f32 {
        let square = |p: &[f32; 3]| {
            let way = sub(*p, place);
            dot(way, way)
        };
        self.solid.iter().map(square).fold(f32::INFINITY, f32::min).sqrt()
    }
}

/// The nearest other camera, by its place, and how far it is. Cameras at one place are as good as none: the nearest that
/// is elsewhere counts.
fn nearest(cameras: &[Camera], own: usize) -> (usize, f32) {
    let centre = cameras[own].centre();
    let mut best = (own, f32::INFINITY);
    for (other, camera) in cameras.iter().enumerate() {
        let way = sub(camera.centre(), centre);
        let distance = dot(way, way).sqrt();
        if other != own && distance > 0.0 && distance < best.1 {
            best = (other, distance);
        }
    }
    match best.1.is_finite() {
        true => best,
        false => (own, 0.0),
    }
}

/// The middle of a camera's picture, `size` by `size` pixels: what is in the shorter side, `zoom` times as wide.
fn square(camera: &Camera, size: u32, zoom: f32) -> Camera {
    let factor = size as f32 / camera.width.min(camera.height) as f32;
    let middle = 0.5 * size as f32;
    Camera {
        width: size,
        height: size,
        fx: camera.fx * factor / zoom,
        fy: camera.fy * factor / zoom,
        cx: middle + factor * (camera.cx - 0.5 * camera.width as f32),
        cy: middle + factor * (camera.cy - 0.5 * camera.height as f32),
        ..camera.clone()
    }
}

#[cfg(test)]
mod tests;
