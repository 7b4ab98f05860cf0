//! From a Gaussian in the world to an elliptic splat in the picture (EWA splatting, constants of the reference).
use super::TILE;
use crate::scene::Gaussians;
use crate::view::Camera;
use crate::view::vector;
use bytemuck::{Pod, Zeroable};

/// Gaussians at this view depth or nearer are not drawn.
pub const NEAR: f32 = 0.2;
/// Added to the diagonal of the 2D covariance, in square pixels: no splat is thinner than about a pixel.
pub const LOW_PASS: f64 = 0.3;
/// Variance of a pixel's area about its middle, in square pixels.
const PIXEL: f64 = 1.0 / 12.0;
/// Smallest contribution that is drawn.
pub const ALPHA_MIN: f32 = 1.0 / 255.0;
/// Log scales are clamped to this: far beyond any scene, and its fourth power is still finite.
const LOG_SCALE_LIMIT: f32 = 30.0;
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

/// Half-open range of tiles, columns then rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TileRect {
    pub x: [u32; 2],
    pub y: [u32; 2],
}

impl TileRect {
    pub fn area(&self) -> u64 {
        u64::from(self.x[1].saturating_sub(self.x[0])) * u64::from(self.y[1].saturating_sub(self.y[0]))
    }
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

    /// The splat of Gaussian `row` and the tiles it may touch, or `None` when it cannot be seen.
    ///
    /// Covariances are computed in double precision, as a sum of squares: unlike in the reference, a large log scale
    /// does not overflow and the determinant is never 0 or negative, so its test for that cannot fire.
    /// A Gaussian whose numbers are not finite is not drawn.
    pub fn project(&self, gaussians: &Gaussians, row: usize) -> Option<(Splat2d, TileRect)> {
        let p = gaussians.positions[row].map(f64::from);
        let w = &self.rotation;
        let t: [f64; 3] =
            std::array::from_fn(|r| w[r][0] * p[0] + w[r][1] * p[1] + w[r][2] * p[2] + self.translation[r]);
        if !(t[2] > f64::from(NEAR) && t[2].is_finite()) {
            return None;
        }
        let inverse_depth = 1.0 / (t[2] + 1e-7);
        let mean: [f64; 2] = std::array::from_fn(|k| self.focal[k] * t[k] * inverse_depth + self.principal[k] - 0.5);
        let m = self.footprint(t, rotation(gaussians.rotations[row]), gaussians.log_scales[row]);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (plain_xx, xy, plain_yy) = (dot(m[0], m[0]), dot(m[0], m[1]), dot(m[1], m[1]));
        let low_pass = self.low_pass;
        let (xx, yy) = (plain_xx + low_pass, plain_yy + low_pass);
        // Cauchy-Binet: det(M M^T) is the sum of the squared minors of M, which does not cancel.
        let minor = |i: usize, j: usize| m[0][i] * m[1][j] - m[0][j] * m[1][i];
        let minors = minor(0, 1).powi(2) + minor(0, 2).powi(2) + minor(1, 2).powi(2);
        let determinant = |low_pass: f64| low_pass * low_pass + low_pass * (plain_xx + plain_yy) + minors;
        let det = determinant(low_pass);
        let mut opacity = gaussians.opacity(row);
        if self.fine < low_pass {
            opacity *= (determinant(self.fine) / det).sqrt() as f32;
        }
        let reach = 2.0 * (255.0 * f64::from(opacity)).ln();
        if reach.is_nan() || reach < -1e-4 {
            return None;
        }
        let half = 0.5 * (xx - yy);
        let largest = 0.5 * (xx + yy) + (half * half + xy * xy).max(0.1).sqrt();
        let radius = (3.0 * largest.sqrt()).ceil();
        let splat = Splat2d {
            mean: mean.map(|v| v as f32),
            inverse_x: (yy / det).sqrt() as f32,
            slope: (xy / yy) as f32,
            inverse_y: (1.0 / yy.sqrt()) as f32,
            opacity,
            depth: t[2] as f32,
            reach: (reach + 1e-3) as f32,
        };
        let finite = splat
            .mean
            .iter()
            .chain([&splat.inverse_x, &splat.slope, &splat.inverse_y])
            .all(|v| v.is_finite());
        if !finite || !radius.is_finite() {
            return None;
        }
        let q = reach + 1e-3;
        let extent = [xx, yy].map(|variance| (q * variance).sqrt() + REACH_SLACK);
        let x = self.tile_range(0, mean[0], radius, extent[0]);
        let y = self.tile_range(1, mean[1], radius, extent[1]);
        (x[0] < x[1] && y[0] < y[1]).then_some((splat, TileRect { x, y }))
    }

    /// Tiles along `axis`: those of the reference (from the 3 sigma radius), less those beyond the ellipse's bounds.
    fn tile_range(&self, axis: usize, mean: f64, radius: f64, extent: f64) -> [u32; 2] {
        let (tile, count) = (f64::from(TILE), f64::from(self.tiles[axis]));
        // The conversion truncates, as the reference does, and here also rounds down: nothing is negative any more.
        let clamp = |v: f64| v.clamp(0.0, count) as u32;
        let low = clamp((mean - radius) / tile);
        let high = clamp((mean + radius + tile - 1.0) / tile);
        let first = clamp((mean - extent).ceil() / tile);
        let end = mean + extent;
        let last = if end < 0.0 { 0 } else { clamp(end / tile + 1.0) };
        [low.max(first), high.min(last)]
    }

    /// `J W R S` (2 x 3): its product with its transpose is the 2D covariance before the low-pass filter.
    fn footprint(&self, t: [f64; 3], r: [[f64; 3]; 3], log_scale: [f32; 3]) -> [[f64; 3]; 2] {
        // A NaN passes the clamp and is caught by the caller's test for finite numbers.
        let scale = log_scale.map(|s| f64::from(s.clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT)).exp());
        std::array::from_fn(|k| {
            let clamped = (t[k] / t[2]).clamp(-self.limit[k], self.limit[k]);
            let (j, j_depth) = (self.focal[k] / t[2], -self.focal[k] * clamped / t[2]);
            let jw: [f64; 3] = std::array::from_fn(|c| j * self.rotation[k][c] + j_depth * self.rotation[2][c]);
            std::array::from_fn(|c| (jw[0] * r[0][c] + jw[1] * r[1][c] + jw[2] * r[2][c]) * scale[c])
        })
    }
}

/// Rotation matrix of a quaternion w, x, y, z of any length; all zero (whole files of them exist) is the identity,
/// as in the reference, where normalisation leaves a zero quaternion zero.
fn rotation(q: [f32; 4]) -> [[f64; 3]; 3] {
    let q = q.map(f64::from);
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    vector::rotation(if norm > 0.0 && norm.is_finite() {
        q.map(|v| v / norm)
    } else {
        [1.0, 0.0, 0.0, 0.0]
    })
}
