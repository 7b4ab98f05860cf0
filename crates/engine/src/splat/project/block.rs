//! Gaussians projected a register of them at a time: one array a quantity, loops over indices.
use super::{NEAR, Projected, Projector, REACH_SLACK, Splat2d, TileRect};
use crate::simd::Vectorised;
use crate::splat::TILE;
use crate::splat::geometry::Geometry;
use crate::view::vector;
use std::ops::Range;

/// Rows that are computed together, a register of them at a time.
const BLOCK: usize = 64;

/// Projects some rows.
pub(super) struct Project<'a> {
    pub projector: &'a Projector,
    pub geometry: &'a Geometry<'a>,
    pub rows: Range<usize>,
}

impl Vectorised for Project<'_> {
    type Output = Projected;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Projected {
        let mut out = Projected::default();
        let mut block = Block::new();
        for first in self.rows.clone().step_by(BLOCK) {
            let rows = first..self.rows.end.min(first + BLOCK);
            if block.place(self.projector, &self.geometry.gaussians.positions[rows.clone()]) {
                block.cover(self.projector, self.geometry, rows.clone());
                block.bound(self.projector);
                block.collect(rows, &mut out);
            }
        }
        out
    }
}

/// What is computed of some rows: one array a quantity.
struct Block {
    centre: [[f32; BLOCK]; 3],
    rotation: [[f32; BLOCK]; 4],
    scale: [[f64; BLOCK]; 3],
    /// The centre in the camera's axes.
    position: [[f64; BLOCK]; 3],
    mean: [[f64; BLOCK]; 2],
    /// Variances along the picture's axes.
    variance: [[f64; BLOCK]; 2],
    /// Radius in pixels as the reference has it.
    radius: [f64; BLOCK],
    inverse_x: [f32; BLOCK],
    slope: [f32; BLOCK],
    inverse_y: [f32; BLOCK],
    opacity: [f32; BLOCK],
    /// What of the opacity a mean over larger pixels leaves.
    share: [f32; BLOCK],
    reach: [f64; BLOCK],
    /// Whether the row can be seen, as far as is known.
    seen: [bool; BLOCK],
    /// First tiles, and those behind the last.
    tiles: [[[f64; BLOCK]; 2]; 2],
}

impl Block {
    fn new() -> Self {
        Block {
            centre: [[0.0; BLOCK]; 3],
            rotation: [[0.0; BLOCK]; 4],
            scale: [[0.0; BLOCK]; 3],
            position: [[0.0; BLOCK]; 3],
            mean: [[0.0; BLOCK]; 2],
            variance: [[0.0; BLOCK]; 2],
            radius: [0.0; BLOCK],
            inverse_x: [0.0; BLOCK],
            slope: [0.0; BLOCK],
            inverse_y: [0.0; BLOCK],
            opacity: [0.0; BLOCK],
            share: [0.0; BLOCK],
            reach: [0.0; BLOCK],
            seen: [false; BLOCK],
            tiles: [[[0.0; BLOCK]; 2]; 2],
        }
    }

    /// Puts centres into the camera's axes; returns whether any is far enough in front of it.
    #[inline(always)]
    fn place(&mut self, camera: &Projector, positions: &[[f32; 3]]) -> bool {
        transpose(&mut self.centre, positions);
        let w = &camera.rotation;
        for r in 0..3 {
            for i in 0..BLOCK {
                let [x, y, z] = &self.centre;
                let (x, y, z) = (f64::from(x[i]), f64::from(y[i]), f64::from(z[i]));
                self.position[r][i] = w[r][0] * x + w[r][1] * y + w[r][2] * z + camera.translation[r];
            }
        }
        for i in 0..BLOCK {
            let depth = self.position[2][i];
            self.seen[i] = (depth > f64::from(NEAR)) & (depth < f64::INFINITY);
        }
        self.seen[positions.len()..].fill(false);
        self.seen.iter().any(|seen| *seen)
    }

    /// Ellipses and opacities.
    #[inline(always)]
    fn cover(&mut self, camera: &Projector, geometry: &Geometry<'_>, rows: Range<usize>) {
        let count = rows.len();
        transpose(&mut self.rotation, &geometry.gaussians.rotations[rows.clone()]);
        transpose(&mut self.scale, &geometry.scales[rows.clone()]);
        self.opacity[..count].copy_from_slice(&geometry.opacities[rows]);
        for i in 0..BLOCK {
            self.ellipse(camera, i);
        }
        if camera.fine < camera.low_pass {
            for i in 0..BLOCK {
                self.opacity[i] *= self.share[i];
            }
        }
        for i in 0..count {
            // What is no number cannot be seen either.
            let opacity = f64::from(self.opacity[i]);
            self.reach[i] = if self.seen[i] {
                2.0 * (255.0 * opacity).ln()
            } else {
                f64::NAN
            };
        }
    }

    #[inline(always)]
    fn ellipse(&mut self, camera: &Projector, i: usize) {
        // Without `map` of arrays, which is not always inlined.
        let t = [self.position[0][i], self.position[1][i], self.position[2][i]];
        let inverse_depth = 1.0 / (t[2] + 1e-7);
        let rotation = orientation([
            self.rotation[0][i],
            self.rotation[1][i],
            self.rotation[2][i],
            self.rotation[3][i],
        ]);
        let m = camera.footprint(t, rotation, [self.scale[0][i], self.scale[1][i], self.scale[2][i]]);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (plain_xx, xy, plain_yy) = (dot(m[0], m[0]), dot(m[0], m[1]), dot(m[1], m[1]));
        let low_pass = camera.low_pass;
        let (xx, yy) = (plain_xx + low_pass, plain_yy + low_pass);
        // Cauchy-Binet: det(M M^T) is the sum of the squared minors of M, which does not cancel.
        let square_of_minor = |i: usize, j: usize| {
            let minor = m[0][i] * m[1][j] - m[0][j] * m[1][i];
            minor * minor
        };
        let minors = square_of_minor(0, 1) + square_of_minor(0, 2) + square_of_minor(1, 2);
        let determinant = |low_pass: f64| low_pass * low_pass + low_pass * (plain_xx + plain_yy) + minors;
        let det = determinant(low_pass);
        let half = 0.5 * (xx - yy);
        let largest = 0.5 * (xx + yy) + (half * half + xy * xy).max(0.1).sqrt();
        let radius = (3.0 * largest.sqrt()).ceil();
        for k in 0..2 {
            self.mean[k][i] = camera.focal[k] * t[k] * inverse_depth + camera.principal[k] - 0.5;
        }
        self.variance[0][i] = xx;
        self.variance[1][i] = yy;
        self.radius[i] = radius;
        self.inverse_x[i] = (yy / det).sqrt() as f32;
        self.slope[i] = (xy / yy) as f32;
        self.inverse_y[i] = (1.0 / yy.sqrt()) as f32;
        self.share[i] = (determinant(camera.fine) / det).sqrt() as f32;
    }

    /// Tiles that ellipses may touch: those of the reference (from the 3 sigma radius), less those beyond the ellipse's
    /// bounds.
    #[inline(always)]
    fn bound(&mut self, camera: &Projector) {
        let tile = f64::from(TILE);
        for axis in 0..2 {
            let tiles = f64::from(camera.tiles[axis]);
            for i in 0..BLOCK {
                let (mean, radius) = (self.mean[axis][i], self.radius[i]);
                let extent = ((self.reach[i] + 1e-3) * self.variance[axis][i]).sqrt() + REACH_SLACK;
                let low = floor_within((mean - radius) / tile, tiles);
                let high = floor_within((mean + radius + tile - 1.0) / tile, tiles);
                let first = floor_within((mean - extent).ceil() / tile, tiles);
                let end = mean + extent;
                let last = floor_within(end / tile + 1.0, tiles);
                let last = if end < 0.0 { 0.0 } else { last };
                self.tiles[axis][0][i] = if low > first { low } else { first };
                self.tiles[axis][1][i] = if high < last { high } else { last };
            }
        }
        for i in 0..BLOCK {
            let [x, y] = &self.tiles;
            let finite = |v: f32| v.abs() < f32::INFINITY;
            self.seen[i] &= (self.reach[i] >= -1e-4)
                & (x[0][i] < x[1][i])
                & (y[0][i] < y[1][i])
                & finite(self.mean[0][i] as f32)
                & finite(self.mean[1][i] as f32)
                & finite(self.inverse_x[i])
                & finite(self.slope[i])
                & finite(self.inverse_y[i])
                & (self.radius[i] < f64::INFINITY);
        }
    }

    #[inline(always)]
    fn collect(&self, rows: Range<usize>, out: &mut Projected) {
        for (i, row) in rows.enumerate() {
            if !self.seen[i] {
                continue;
            }
            out.rows.push(row as u32);
            out.splats.push(Splat2d {
                mean: [self.mean[0][i] as f32, self.mean[1][i] as f32],
                inverse_x: self.inverse_x[i],
                slope: self.slope[i],
                inverse_y: self.inverse_y[i],
                opacity: self.opacity[i],
                depth: self.position[2][i] as f32,
                reach: (self.reach[i] + 1e-3) as f32,
            });
            let [[x0, x1], [y0, y1]] = &self.tiles;
            out.rects.push(TileRect {
                x: [x0[i] as u16, x1[i] as u16],
                y: [y0[i] as u16, y1[i] as u16],
            });
        }
    }
}

/// A quantity a row becomes a row a quantity.
#[inline(always)]
fn transpose<T: Copy, const N: usize>(out: &mut [[T; BLOCK]; N], rows: &[[T; N]]) {
    for (i, row) in rows.iter().enumerate().take(BLOCK) {
        for k in 0..N {
            out[k][i] = row[k];
        }
    }
}

/// `x` rounded down, from 0 to `limit`; 0 for NaN. Stays a floating-point number, which registers hold as many of.
#[inline(always)]
fn floor_within(x: f64, limit: f64) -> f64 {
    let x = if x > 0.0 { x } else { 0.0 };
    (if x < limit { x } else { limit }).floor()
}

impl Projector {
    /// `J W R S` (2 x 3): its product with its transpose is the 2D covariance before the low-pass filter.
    #[inline(always)]
    fn footprint(&self, t: [f64; 3], r: [[f64; 3]; 3], scale: [f64; 3]) -> [[f64; 3]; 2] {
        let mut m = [[0.0; 3]; 2];
        for k in 0..2 {
            let (slope, limit) = (t[k] / t[2], self.limit[k]);
            let clamped = if slope < -limit { -limit } else { slope };
            let clamped = if clamped > limit { limit } else { clamped };
            let (j, j_depth) = (self.focal[k] / t[2], -self.focal[k] * clamped / t[2]);
            let mut jw = [0.0; 3];
            for c in 0..3 {
                jw[c] = j * self.rotation[k][c] + j_depth * self.rotation[2][c];
            }
            for c in 0..3 {
                m[k][c] = (jw[0] * r[0][c] + jw[1] * r[1][c] + jw[2] * r[2][c]) * scale[c];
            }
        }
        m
    }
}

/// Rotation matrix of a quaternion w, x, y, z of any length; all zero (whole files of them exist) is the identity,
/// as in the reference, where normalisation leaves a zero quaternion zero.
#[inline(always)]
fn orientation(q: [f32; 4]) -> [[f64; 3]; 3] {
    let q = [f64::from(q[0]), f64::from(q[1]), f64::from(q[2]), f64::from(q[3])];
    let norm = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let usable = (norm > 0.0) & (norm < f64::INFINITY);
    let one = |v: f64, otherwise: f64| if usable { v / norm } else { otherwise };
    vector::rotation([one(q[0], 1.0), one(q[1], 0.0), one(q[2], 0.0), one(q[3], 0.0)])
}
