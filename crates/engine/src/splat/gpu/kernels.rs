//! CubeCL kernels of the GPU rasteriser: compositing, its transpose, and the sum over slots.
//!
//! One cube of 16 x 16 units a tile, one unit a pixel. They use nothing that lavapipe lacks: no subgroup operations, no
//! float atomics, under 24 KiB of shared memory. Every sum has a fixed order, so results repeat to the byte.
//! Views of a group are drawn side by side: a view a layer of cubes, its words found by the group's table ([`super::batch`]).
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::batch::{
    BACKGROUND, FIELDS, FIRST_COLOUR, FIRST_SLOT, PICTURE, SHAPE, SLOT_LIST, SLOT_START, SPLATS, TILE_LIST, TILE_START,
    VISIBLE,
};
use crate::launch::unit_of_layer;
use crate::splat::composite::{ALPHA_MAX, TRANSMITTANCE_MIN};
use crate::splat::project::ALPHA_MIN;
use crate::splat::tiles;

const PIXELS: usize = tiles::TILE_PIXELS;
const SIDE: u32 = tiles::TILE;
/// The same and a colour.
const SHAPE_AND_COLOUR: usize = SHAPE + 3;
/// Splats whose weights are in shared memory at a time: 16 x 256 floats are 16 KiB.
const BATCH: usize = 16;
/// Units that sum one splat's 256 products: 256 / BATCH.
const SUMMERS: usize = PIXELS / BATCH;

/// A field of a view's row in the table.
#[cube]
pub(super) fn field(table: &[u32], view: usize, #[comptime] which: usize) -> usize {
    table[view * FIELDS + which] as usize
}

/// A field that is a float.
#[cube]
pub(super) fn float_field(table: &[u32], view: usize, #[comptime] which: usize) -> f32 {
    f32::reinterpret(table[view * FIELDS + which])
}

/// Copies `part` to `words` from `at` on.
#[cube(launch)]
pub fn append(part: &[u32], words: &mut [u32], at: u32) {
    let unit = unit_of_layer();
    if unit < part.len() {
        words[at as usize + unit] = part[unit];
    }
}

/// Opacity at a pixel `px`, `py` of the splat whose shape is in `batch` from `at` on; see [`crate::splat::Splat2d`] for the
/// formula.
#[cube]
fn alpha_at(px: f32, py: f32, batch: &Shared<[f32]>, at: usize) -> f32 {
    let dx = px - batch[at];
    let dy = py - batch[at + 1];
    let u = (dx - batch[at + 3] * dy) * batch[at + 2];
    let v = dy * batch[at + 4];
    let power = -0.5f32 * (u * u + v * v);
    min(batch[at + 5] * f32::exp(max(power, -80.0f32)), ALPHA_MAX)
}

/// Draws a tile: `pictures` (`[views][3][height][width]`) from the tile's list, front to back, with the group's `colours`.
#[cube(launch)]
pub fn composite(words: &[u32], table: &[u32], colours: &[f32], pictures: &mut [f32], width: u32, height: u32) {
    let view = CUBE_POS_Z as usize;
    let splats = field(table, view, SPLATS);
    let list = field(table, view, TILE_LIST);
    let first_colour = field(table, view, FIRST_COLOUR);
    let unit = UNIT_POS as usize;
    let tile = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize;
    let x = CUBE_POS_X * SIDE + UNIT_POS_X;
    let y = CUBE_POS_Y * SIDE + UNIT_POS_Y;
    let inside = x < width && y < height;
    let px = f32::cast_from(x);
    let py = f32::cast_from(y);

    let mut batch = Shared::<[f32]>::new_slice(PIXELS * SHAPE_AND_COLOUR);
    let mut live = Shared::<[u32]>::new_slice(1usize);
    let mut open = inside;
    let mut any_open = 1u32;
    let mut transmittance = 1.0f32;
    let mut r = 0.0f32;
    let mut g = 0.0f32;
    let mut b = 0.0f32;

    let start = field(table, view, TILE_START);
    let mut base = words[start + tile] as usize;
    let end = words[start + tile + 1] as usize;
    while base < end && any_open == 1u32 {
        let count = min(end - base, PIXELS);
        if unit < count {
            let index = words[list + base + unit] as usize;
            for k in 0..SHAPE {
                batch[unit * SHAPE_AND_COLOUR + k] = f32::reinterpret(words[splats + index * SHAPE + k]);
            }
            for k in 0..3usize {
                batch[unit * SHAPE_AND_COLOUR + SHAPE + k] = colours[(first_colour + index) * 3 + k];
            }
        }
        if unit == 0 {
            live[0] = 0u32;
        }
        sync_cube();
        let mut k = 0usize;
        while k < count && open {
            let at = k * SHAPE_AND_COLOUR;
            let alpha = alpha_at(px, py, &batch, at);
            if alpha >= ALPHA_MIN {
                let left = transmittance * (1.0f32 - alpha);
                if left < TRANSMITTANCE_MIN {
                    open = false;
                } else {
                    let weight = alpha * transmittance;
                    r += weight * batch[at + 6];
                    g += weight * batch[at + 7];
                    b += weight * batch[at + 8];
                    transmittance = left;
                }
            }
            k += 1;
        }
        // Units that are open all write the same value.
        if open {
            live[0] = 1u32;
        }
        any_open = workgroup_uniform_load(&live[0]);
        base += PIXELS;
    }
    if inside {
        let area = (width * height) as usize;
        let out = field(table, view, PICTURE) * 3 * area + (y * width + x) as usize;
        pictures[out] = r + transmittance * float_field(table, view, BACKGROUND);
        pictures[out + area] = g + transmittance * float_field(table, view, BACKGROUND + 1);
        pictures[out + 2 * area] = b + transmittance * float_field(table, view, BACKGROUND + 2);
    }
}

/// Gradient of a tile to the colours of its splats: the group's `slots` (`[pairs][3]`) get `sum_pixels weight * gradient`,
/// of gradients to pictures `[views][3][height][width]`.
///
/// The units recompute their weights front to back for [`BATCH`] splats at a time and leave them in shared memory;
/// then [`SUMMERS`] units a splat each sum 16 pixels, and one unit a splat sums those.
#[cube(launch)]
pub fn splat_gradients(words: &[u32], table: &[u32], gradient: &[f32], slots: &mut [f32], width: u32, height: u32) {
    let view = CUBE_POS_Z as usize;
    let splats = field(table, view, SPLATS);
    let list = field(table, view, TILE_LIST);
    let first_slot = field(table, view, FIRST_SLOT);
    let unit = UNIT_POS as usize;
    let tile = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize;
    let x = CUBE_POS_X * SIDE + UNIT_POS_X;
    let y = CUBE_POS_Y * SIDE + UNIT_POS_Y;
    let inside = x < width && y < height;
    let px = f32::cast_from(x);
    let py = f32::cast_from(y);

    let mut batch = Shared::<[f32]>::new_slice(BATCH * SHAPE);
    let mut weights = Shared::<[f32]>::new_slice(BATCH * PIXELS);
    let mut pixels = Shared::<[f32]>::new_slice(PIXELS * 3);
    let mut partial = Shared::<[f32]>::new_slice(PIXELS * 3);
    let mut live = Shared::<[u32]>::new_slice(1usize);
    for c in 0..3usize {
        pixels[unit * 3 + c] = 0.0f32;
    }
    if inside {
        let area = (width * height) as usize;
        let at = field(table, view, PICTURE) * 3 * area + (y * width + x) as usize;
        for c in 0..3usize {
            pixels[unit * 3 + c] = gradient[at + c * area];
        }
    }
    let mut open = inside;
    let mut any_open = 1u32;
    let mut transmittance = 1.0f32;

    let start = field(table, view, TILE_START);
    let mut base = words[start + tile] as usize;
    let end = words[start + tile + 1] as usize;
    while base < end && any_open == 1u32 {
        let count = min(end - base, BATCH);
        if unit < count {
            let index = words[list + base + unit] as usize;
            for k in 0..SHAPE {
                batch[unit * SHAPE + k] = f32::reinterpret(words[splats + index * SHAPE + k]);
            }
        }
        if unit == 0 {
            live[0] = 0u32;
        }
        sync_cube();
        for k in 0..count {
            let mut weight = 0.0f32;
            if open {
                let alpha = alpha_at(px, py, &batch, k * SHAPE);
                if alpha >= ALPHA_MIN {
                    let left = transmittance * (1.0f32 - alpha);
                    if left < TRANSMITTANCE_MIN {
                        open = false;
                    } else {
                        weight = alpha * transmittance;
                        transmittance = left;
                    }
                }
            }
            weights[k * PIXELS + unit] = weight;
        }
        if open {
            live[0] = 1u32;
        }
        sync_cube();
        let splat = unit / SUMMERS;
        let summer = unit % SUMMERS;
        if splat < count {
            let mut r = 0.0f32;
            let mut g = 0.0f32;
            let mut b = 0.0f32;
            for j in 0..PIXELS / SUMMERS {
                // Neighbouring units read neighbouring pixels.
                let pixel = j * SUMMERS + summer;
                let weight = weights[splat * PIXELS + pixel];
                r += weight * pixels[pixel * 3];
                g += weight * pixels[pixel * 3 + 1];
                b += weight * pixels[pixel * 3 + 2];
            }
            partial[unit * 3] = r;
            partial[unit * 3 + 1] = g;
            partial[unit * 3 + 2] = b;
        }
        sync_cube();
        if unit < count {
            for c in 0..3usize {
                let mut sum = 0.0f32;
                for j in 0..SUMMERS {
                    sum += partial[(unit * SUMMERS + j) * 3 + c];
                }
                slots[(first_slot + base + unit) * 3 + c] = sum;
            }
        }
        any_open = workgroup_uniform_load(&live[0]);
        base += BATCH;
    }
    // Splats behind the last open pixel have no weight.
    let mut slot = base + unit;
    while slot < end {
        for c in 0..3usize {
            slots[(first_slot + slot) * 3 + c] = 0.0f32;
        }
        slot += PIXELS;
    }
}

/// The gradient to a visible Gaussian's colour: the sum of its slots in ascending order.
#[cube]
pub(super) fn sum_of_slots(
    words: &[u32],
    table: &[u32],
    slots: &[f32],
    view: usize,
    gaussian: usize,
) -> (f32, f32, f32) {
    let start = field(table, view, SLOT_START) + gaussian;
    let list = field(table, view, SLOT_LIST);
    let first_slot = field(table, view, FIRST_SLOT);
    let mut r = 0.0f32;
    let mut g = 0.0f32;
    let mut b = 0.0f32;
    let mut k = words[start] as usize;
    let end = words[start + 1] as usize;
    while k < end {
        let at = (first_slot + words[list + k] as usize) * 3;
        r += slots[at];
        g += slots[at + 1];
        b += slots[at + 2];
        k += 1;
    }
    (r, g, b)
}

/// Sums each visible Gaussian's slots: the group's `out` (`[colours][3]`).
#[cube(launch)]
pub fn sum_slots(words: &[u32], table: &[u32], slots: &[f32], out: &mut [f32]) {
    let view = CUBE_POS_Z as usize;
    let gaussian = unit_of_layer();
    if gaussian < field(table, view, VISIBLE) {
        let (r, g, b) = sum_of_slots(words, table, slots, view, gaussian);
        let at = (field(table, view, FIRST_COLOUR) + gaussian) * 3;
        out[at] = r;
        out[at + 1] = g;
        out[at + 2] = b;
    }
}
