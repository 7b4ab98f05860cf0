//! Spherical harmonics: from coefficients to the colour seen from a direction, and the gradient back.
mod colours;
mod gradient;
mod lanes;

use std::ops::Range;

pub use colours::{colours, colours_of_views};
pub use gradient::{ColourGradient, backward, backward_of_views};
use lanes::{LANES, Number};

/// Coefficients a channel at the highest degree.
pub const MAX_COEFFICIENTS: usize = 25;

pub(super) const C0: f32 = 0.282_094_8;
pub(super) const C1: f32 = 0.488_602_52;
pub(super) const C2: [f32; 5] = [1.092_548_5, -1.092_548_5, 0.315_391_57, -1.092_548_5, 0.546_274_24];
pub(super) const C3: [f32; 7] = [
    -0.590_043_6,
    2.890_611_4,
    -0.457_045_8,
    0.373_176_34,
    -0.457_045_8,
    1.445_305_7,
    -0.590_043_6,
];
pub(super) const C4: [f32; 9] = [
    2.503_343,
    -1.770_130_8,
    0.946_174_7,
    -0.669_046_6,
    0.105_785_55,
    -0.669_046_6,
    0.473_087_34,
    -1.770_130_8,
    0.625_835_8,
];

/// Values of the real spherical harmonics for the unit direction `dir`; those above `degree` are 0.
///
/// Order, signs and constants are those of the graphdeco reference up to degree 3 and of gsplat for degree 4.
pub fn basis(degree: usize, dir: [f32; 3]) -> [f32; MAX_COEFFICIENTS] {
    basis_of(degree, dir)
}

/// [`basis`] of one direction, or of some side by side.
#[inline(always)]
fn basis_of<T: Number>(degree: usize, dir: [T; 3]) -> [T; MAX_COEFFICIENTS] {
    let [x, y, z] = dir;
    let mut b = [T::of(0.0); MAX_COEFFICIENTS];
    b[0] = T::of(C0);
    if degree == 0 {
        return b;
    }
    b[1] = y * -C1;
    b[2] = z * C1;
    b[3] = x * -C1;
    if degree == 1 {
        return b;
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, yz, xz) = (x * y, y * z, x * z);
    b[4] = xy * C2[0];
    b[5] = yz * C2[1];
    b[6] = (zz * 2.0 - xx - yy) * C2[2];
    b[7] = xz * C2[3];
    b[8] = (xx - yy) * C2[4];
    if degree == 2 {
        return b;
    }
    b[9] = y * C3[0] * (xx * 3.0 - yy);
    b[10] = xy * C3[1] * z;
    b[11] = y * C3[2] * (zz * 4.0 - xx - yy);
    b[12] = z * C3[3] * (zz * 2.0 - xx * 3.0 - yy * 3.0);
    b[13] = x * C3[4] * (zz * 4.0 - xx - yy);
    b[14] = z * C3[5] * (xx - yy);
    b[15] = x * C3[6] * (xx - yy * 3.0);
    if degree == 3 {
        return b;
    }
    let one = T::of(1.0);
    b[16] = xy * C4[0] * (xx - yy);
    b[17] = yz * C4[1] * (xx * 3.0 - yy);
    b[18] = xy * C4[2] * (zz * 7.0 - one);
    b[19] = yz * C4[3] * (zz * 7.0 - T::of(3.0));
    b[20] = (zz * (zz * 35.0 - T::of(30.0)) + T::of(3.0)) * C4[4];
    b[21] = xz * C4[5] * (zz * 7.0 - T::of(3.0));
    b[22] = (xx - yy) * C4[6] * (zz * 7.0 - one);
    b[23] = xz * C4[7] * (xx - yy * 3.0);
    b[24] = (xx * (xx - yy * 3.0) - yy * (xx * 3.0 - yy)) * C4[8];
    b
}

/// Coefficients a channel up to `degree`.
fn terms(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Rows of coefficients that one task takes: with what is learned of them they fit the second cache, so that memory is read
/// once for all views.
const ROWS: usize = 1024;

/// Where rows `0..ROWS`, `ROWS..2 ROWS` and so on are in ascending rows.
fn parts(rows: &[u32]) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    (1..).map(move |part: usize| {
        let end = start + rows[start..].partition_point(|row| (*row as usize) < part * ROWS);
        std::mem::replace(&mut start, end)..end
    })
}

/// How many of ascending rows, at most [`LANES`] of them below `end`, are below it.
#[inline(always)]
fn below(rows: &[u32], end: usize) -> usize {
    let near = &rows[..rows.len().min(LANES)];
    near.iter().map(|row| usize::from((*row as usize) < end)).sum()
}

/// So many times Gaussians of a group must be seen, for the group to be computed side by side: putting coefficients side by
/// side takes as long as so many colours take one by one.
const WORTH_LANES: usize = 8;

#[cfg(test)]
mod tests;
