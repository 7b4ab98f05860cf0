//! From a Gaussian in the world to an elliptic splat in the picture (EWA splatting, constants of the reference).
mod block;

use self::block::Project;
use super::TILE;
use super::geometry::Geometry;
use crate::scene::Gaussians;
use crate::simd::Instructions;
use crate::view::Camera;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Gaussians at this view depth or nearer are not drawn.
pub const NEAR: f32 = 0.2;
/// Added to the diagonal of the 2D covariance, in square pixels: no splat is thinner than about a pixel.
pub const LOW_PASS: f64 = 0.3;
/// Variance of a pixel's area about its middle, in square pixels.
const PIXEL: f64 = 1.0 / 12.0;
/// Smallest contribution that is drawn.
pub const ALPHA_MIN: f32 = 1.0 / 255.0;
/// Slack on the bounds of an ellipse, so that rounding never drops a pixel that the alpha test would keep.
const REACH_SLACK: f64 = 1e-2;

/// A Gaussian as seen by one camera; 32 bytes, the layout that the kernels read.
///
/// The conic (inverse 2D covariance) is kept as its Cholesky factor: with `dx`, `dy` the offset of a pixel from `mean`,
/// `u = (dx - slope dy) inverse_x`, `v = dy inverse_y`, the exponent is `-(u^2 + v^2) / 2`. That equals the reference's
/// `-(a dx^2 + c dy^2) / 2 - b dx dy`, but cannot become positive and does not cancel for needles, where the
/// expanded form loses three digits in single precision.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Splat2d {
    /// Centre in pixel indices: the middle of the first pixel is (0, 0).
    pub mean: [f32; 2],
    /// `sqrt(C_yy / det C)`: one over the deviation along a row.
    pub inverse_x: f32,
    /// `C_xy / C_yy`: how far the ridge moves to the right per row.
    pub slope: f32,
    /// `1 / sqrt(C_yy)`.
    pub inverse_y: f32,
    /// In (0, 1).
    pub opacity: f32,
    /// Depth along the camera's axis, world units.
    pub depth: f32,
    /// `2 ln(255 opacity)` with some slack: where `u^2 + v^2` is larger, alpha is below [`ALPHA_MIN`].
    pub reach: f32,
}

/// Half-open range of tiles, columns then rows. A picture has at most 1024 each way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TileRect {
    pub x: [u16; 2],
    pub y: [u16; 2],
}

impl TileRect {
    pub fn area(&self) -> u64 {
        u64::from(self.x[1].saturating_sub(self.x[0])) * u64::from(self.y[1].saturating_sub(self.y[0]))
    }
}

/// Gaussians that may be seen, in ascending order of rows.
#[derive(Default)]
pub(crate) struct Projected {
    /// Their rows.
    pub rows: Vec<u32>,
    /// Their splats.
    pub splats: Vec<Splat2d>,
    /// The tiles that each may touch.
    pub rects: Vec<TileRect>,
}

/// The camera in double precision, with what every Gaussian needs of it.
pub(crate) struct Projector {
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    focal: [f64; 2],
    principal: [f64; 2],
    limit: [f64; 2],
    centre: [f64; 3],
    tiles: [u32; 2],
    /// Low pass of the larger picture that the view stands for, in the view's square pixels.
    fine: f64,
    /// That, and the mean over the view's pixels.
    low_pass: f64,
}

impl Projector {
    /// For a view that stands for a picture `times` as large, averaged down to the camera's size; at 1 for itself.
    ///
    /// Splats of the larger picture are widened by its own pixels only, and then by the mean over a pixel of the view,
    /// whose box is replaced by the normal distribution of its variance; the mean keeps a splat's sum, so its opacity
    /// falls as its area grows.
    pub fn new(camera: &Camera, times: f64) -> Self {
        let share = times.powi(-2);
        let fine = LOW_PASS * share;
        let rotation = camera.rotation.map(|r| r.map(f64::from));
        let translation = camera.translation.map(f64::from);
        let focal = [camera.fx, camera.fy].map(f64::from);
        let size = [camera.width, camera.height];
        Projector {
            rotation,
            translation,
            focal,
            principal: [camera.cx, camera.cy].map(f64::from),
            limit: std::array::from_fn(|k| 1.3 * f64::from(size[k]) / (2.0 * focal[k])),
            centre: std::array::from_fn(|k| -(0..3).map(|r| rotation[r][k] * translation[r]).sum::<f64>()),
            tiles: size.map(|s| s.div_ceil(TILE)),
            fine,
            low_pass: fine + PIXEL * (1.0 - share),
        }
    }

    /// Unit vector from the camera to Gaussian `row`; along the camera's axis where the two coincide.
    pub fn direction(&self, gaussians: &Gaussians, row: usize) -> [f32; 3] {
        let p = gaussians.positions[row];
        let d: [f64; 3] = std::array::from_fn(|k| f64::from(p[k]) - self.centre[k]);
        let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length > 0.0 {
            d.map(|v| (v / length) as f32)
        } else {
            self.rotation[2].map(|v| v as f32)
        }
    }

    /// The splats of some rows, and the tiles that they may touch, of those that can be seen.
    ///
    /// Covariances are computed in double precision, as a sum of squares: unlike in the reference, a large log scale
    /// does not overflow and the determinant is never 0 or negative, so its test for that cannot fire.
    /// A Gaussian whose numbers are not finite is not drawn. Nothing is fused: the bytes are the same on every
    /// instruction set of an architecture.
    pub fn project(&self, instructions: Instructions, geometry: &Geometry<'_>, rows: Range<usize>) -> Projected {
        instructions.run(Project {
            projector: self,
            geometry,
            rows,
        })
    }
}
