//! CubeCL kernels of the spherical harmonics: colours of visible Gaussians, and what gradients to them mean for coefficients.
//!
//! As [`crate::splat::sh`] does it on the CPU, in the same order of sums.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::batch::{AXIS, CENTRE, CENTRE_REST, FIRST_COLOUR, ROWS, TERMS, VISIBLE};
use super::kernels::{field, float_field, sum_of_slots};
use crate::launch::unit_of_layer;
use crate::splat::sh::{C0, C1, C2, C3, C4};

/// The slot of a Gaussian that is not learned.
pub(super) const NO_SLOT: u32 = u32::MAX;

/// Values of the real spherical harmonics for a unit direction, up to a degree: [`crate::splat::sh::basis`].
#[cube]
fn basis(x: f32, y: f32, z: f32, #[comptime] degree: usize) -> Array<f32> {
    let mut b = Array::<f32>::new(comptime!((degree + 1) * (degree + 1)));
    b[0] = C0;
    if comptime!(degree >= 1) {
        b[1] = -C1 * y;
        b[2] = C1 * z;
        b[3] = -C1 * x;
    }
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    let xy = x * y;
    let yz = y * z;
    let xz = x * z;
    if comptime!(degree >= 2) {
        b[4] = C2[0] * xy;
        b[5] = C2[1] * yz;
        b[6] = C2[2] * (2.0f32 * zz - xx - yy);
        b[7] = C2[3] * xz;
        b[8] = C2[4] * (xx - yy);
    }
    if comptime!(degree >= 3) {
        b[9] = C3[0] * y * (3.0f32 * xx - yy);
        b[10] = C3[1] * xy * z;
        b[11] = C3[2] * y * (4.0f32 * zz - xx - yy);
        b[12] = C3[3] * z * (2.0f32 * zz - 3.0f32 * xx - 3.0f32 * yy);
        b[13] = C3[4] * x * (4.0f32 * zz - xx - yy);
        b[14] = C3[5] * z * (xx - yy);
        b[15] = C3[6] * x * (xx - 3.0f32 * yy);
    }
    if comptime!(degree >= 4) {
        b[16] = C4[0] * xy * (xx - yy);
        b[17] = C4[1] * yz * (3.0f32 * xx - yy);
        b[18] = C4[2] * xy * (7.0f32 * zz - 1.0f32);
        b[19] = C4[3] * yz * (7.0f32 * zz - 3.0f32);
        b[20] = C4[4] * (zz * (35.0f32 * zz - 30.0f32) + 3.0f32);
        b[21] = C4[5] * xz * (7.0f32 * zz - 3.0f32);
        b[22] = C4[6] * (xx - yy) * (7.0f32 * zz - 1.0f32);
        b[23] = C4[7] * xz * (xx - 3.0f32 * yy);
        b[24] = C4[8] * (xx * (xx - 3.0f32 * yy) - yy * (3.0f32 * xx - yy));
    }
    b
}

/// A coordinate from a view's camera to a Gaussian, whose own is `position`; exact to a rounding, however far both are
/// from the origin.
#[cube]
fn from_camera(table: &[u32], view: usize, position: f32, #[comptime] k: usize) -> f32 {
    position - float_field(table, view, CENTRE + k) - float_field(table, view, CENTRE_REST + k)
}

/// The unit vector from a view's camera to a Gaussian of `positions` (`[rows][3]`); along its axis where the two coincide.
#[cube]
fn direction_to(positions: &[f32], table: &[u32], view: usize, row: usize) -> (f32, f32, f32) {
    let mut x = from_camera(table, view, positions[3 * row], 0usize);
    let mut y = from_camera(table, view, positions[3 * row + 1], 1usize);
    let mut z = from_camera(table, view, positions[3 * row + 2], 2usize);
    let largest = max(max(f32::abs(x), f32::abs(y)), f32::abs(z));
    if largest > 0.0f32 {
        // Squares of what is far or near beyond measure would be no numbers.
        x /= largest;
        y /= largest;
        z /= largest;
        let length = f32::sqrt(x * x + y * y + z * z);
        x /= length;
        y /= length;
        z /= length;
    } else {
        x = float_field(table, view, AXIS);
        y = float_field(table, view, AXIS + 1);
        z = float_field(table, view, AXIS + 2);
    }
    (x, y, z)
}

/// A colour as it is drawn: not below 0, before and after the noise.
#[cube]
fn shown(colour: f32, noise: f32) -> f32 {
    max(max(colour, 0.0f32) + noise, 0.0f32)
}

/// Colours of the visible Gaussians of a group that are of a chunk of rows: the group's `colours` (`[colours][3]`), and
/// `originals` without what is learned.
///
/// `positions` (`[rows][3]`) and `coefficients` (`[rows][columns of the degree]`) are the chunk's. `offsets` (`[slots][learned]`) are added where a row has a
/// slot, `noise` to all colours if `noisy`.
#[cube(launch)]
pub fn colours_of_rows(
    words: &[u32],
    table: &[u32],
    positions: &[f32],
    coefficients: &[f32],
    slots: &[u32],
    offsets: &[f32],
    noise: &[f32],
    colours: &mut [f32],
    originals: &mut [f32],
    first_row: u32,
    #[comptime] degree: usize,
    #[comptime] learned: usize,
    #[comptime] noisy: bool,
) {
    let view = CUBE_POS_Z as usize;
    let gaussian = unit_of_layer();
    if gaussian < field(table, view, VISIBLE) {
        let row = words[field(table, view, ROWS) + gaussian];
        if row >= first_row && ((row - first_row) as usize) < slots.len() {
            let row = (row - first_row) as usize;
            let columns = comptime!(3 * (degree + 1) * (degree + 1));
            let at = row * columns;
            let terms = field(table, view, TERMS);
            let (x, y, z) = direction_to(positions, table, view, row);
            let values = basis(x, y, z, degree);
            let slot = slots[row];
            let mut r = 0.5f32;
            let mut g = 0.5f32;
            let mut b = 0.5f32;
            let mut r_before = 0.5f32;
            let mut g_before = 0.5f32;
            let mut b_before = 0.5f32;
            #[unroll]
            for k in 0..comptime!((degree + 1) * (degree + 1)) {
                if k < terms {
                    let mut red = coefficients[at + 3 * k];
                    let mut green = coefficients[at + 3 * k + 1];
                    let mut blue = coefficients[at + 3 * k + 2];
                    r_before += values[k] * red;
                    g_before += values[k] * green;
                    b_before += values[k] * blue;
                    if comptime!(3 * k < learned) {
                        let from = slot as usize * learned + 3 * k;
                        if slot != NO_SLOT {
                            red += offsets[from];
                            green += offsets[from + 1];
                            blue += offsets[from + 2];
                        }
                    }
                    r += values[k] * red;
                    g += values[k] * green;
                    b += values[k] * blue;
                }
            }
            let out = (field(table, view, FIRST_COLOUR) + gaussian) * 3;
            let mut noise_r = 0.0f32;
            let mut noise_g = 0.0f32;
            let mut noise_b = 0.0f32;
            if noisy {
                noise_r = noise[out];
                noise_g = noise[out + 1];
                noise_b = noise[out + 2];
            }
            colours[out] = shown(r, noise_r);
            colours[out + 1] = shown(g, noise_g);
            colours[out + 2] = shown(b, noise_b);
            originals[out] = shown(r_before, noise_r);
            originals[out + 1] = shown(g_before, noise_g);
            originals[out + 2] = shown(b_before, noise_b);
        }
    }
}

/// A unit for each slot of a chunk: what the gradients of a group's views mean for its coefficients, view by view, to
/// `gradient` (`[slots][learned]`), which keeps what it holds if `add`. `positions` are the chunk's, from `first_row` on.
///
/// Where a colour is 0 it was clamped, and its gradient is 0.
#[cube(launch)]
pub fn coefficient_gradients(
    words: &[u32],
    table: &[u32],
    slot_gradients: &[f32],
    colours: &[f32],
    positions: &[f32],
    rows: &[u32],
    gradient: &mut [f32],
    first_row: u32,
    views: u32,
    #[comptime] degree: usize,
    #[comptime] add: bool,
) {
    let slot = unit_of_layer();
    if slot < rows.len() {
        let row = rows[slot];
        let count = comptime!((degree + 1) * (degree + 1));
        let at = slot * comptime!(3 * count);
        let mut sums = Array::<f32>::new(comptime!(3 * count));
        #[unroll]
        for k in 0..comptime!(3 * count) {
            if add {
                sums[k] = gradient[at + k];
            } else {
                sums[k] = 0.0f32;
            }
        }
        for view in 0..views as usize {
            let of_view = field(table, view, ROWS);
            let visible = field(table, view, VISIBLE);
            // Rows of a view ascend.
            let mut low = 0usize;
            let mut high = visible;
            while low < high {
                let middle = (low + high) / 2;
                if words[of_view + middle] < row {
                    low = middle + 1;
                } else {
                    high = middle;
                }
            }
            let mut found = low < visible;
            if found {
                found = words[of_view + low] == row;
            }
            if found {
                let (to_r, to_g, to_b) = sum_of_slots(words, table, slot_gradients, view, low);
                let of_colour = (field(table, view, FIRST_COLOUR) + low) * 3;
                let mut r = 0.0f32;
                let mut g = 0.0f32;
                let mut b = 0.0f32;
                if colours[of_colour] > 0.0f32 {
                    r = to_r;
                }
                if colours[of_colour + 1] > 0.0f32 {
                    g = to_g;
                }
                if colours[of_colour + 2] > 0.0f32 {
                    b = to_b;
                }
                let terms = field(table, view, TERMS);
                let (x, y, z) = direction_to(positions, table, view, (row - first_row) as usize);
                let values = basis(x, y, z, degree);
                #[unroll]
                for k in 0..count {
                    if k < terms {
                        sums[3 * k] += values[k] * r;
                        sums[3 * k + 1] += values[k] * g;
                        sums[3 * k + 2] += values[k] * b;
                    }
                }
            }
        }
        #[unroll]
        for k in 0..comptime!(3 * count) {
            gradient[at + k] = sums[k];
        }
    }
}
