//! CubeCL kernels of the GPU rasteriser: compositing, its transpose, and the sum over slots.
//!
//! One cube of 16 x 16 units a tile, one unit a pixel. They use nothing that lavapipe lacks: no subgroup operations, no
//! float atomics, under 24 KiB of shared memory. Every sum has a fixed order, so results repeat to the byte.
//! Views of a batch share a buffer of pictures and one of gradients to them, in which a view begins at `first_pixel`.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::composite::{ALPHA_MAX, TRANSMITTANCE_MIN};
use super::project::ALPHA_MIN;

/// Floats of a [`super::Splat2d`] in a buffer.
pub(super) const SPLAT_FLOATS: usize = 8;
const PIXELS: usize = super::tiles::TILE_PIXELS;
const SIDE: u32 = super::tiles::TILE;
/// Floats of a splat that compositing needs: the first six of `Splat2d`.
const SHAPE: usize = 6;
/// The same and a colour.
const SHAPE_AND_COLOUR: usize = SHAPE + 3;
/// Splats whose weights are in shared memory at a time: 16 x 256 floats are 16 KiB.
const BATCH: usize = 16;
/// Units that sum one splat's 256 products: 256 / BATCH.
const SUMMERS: usize = PIXELS / BATCH;

/// Opacity of a splat at a pixel `dx`, `dy` from its centre; see [`super::Splat2d`] for the formula.
#[cube]
fn alpha_at(dx: f32, dy: f32, inverse_x: f32, slope: f32, inverse_y: f32, opacity: f32) -> f32 {
    let u = (dx - slope * dy) * inverse_x;
    let v = dy * inverse_y;
    let power = -0.5f32 * (u * u + v * v);
    min(opacity * f32::exp(max(power, -80.0f32)), ALPHA_MAX)
}

/// Draws a tile: `pictures` (`[views][3][height][width]`) from the tile's list, front to back.
#[cube(launch)]
pub fn composite(
    splats: &[f32],
    start: &[u32],
    list: &[u32],
    colours: &[f32],
    pictures: &mut [f32],
    first_pixel: u32,
    width: u32,
    height: u32,
    red: f32,
    green: f32,
    blue: f32,
) {
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

    let mut base = start[tile] as usize;
    let end = start[tile + 1] as usize;
    while base < end && any_open == 1u32 {
        let count = min(end - base, PIXELS);
        if unit < count {
            let index = list[base + unit] as usize;
            for k in 0..SHAPE {
                batch[unit * SHAPE_AND_COLOUR + k] = splats[index * SPLAT_FLOATS + k];
            }
            for k in 0..3usize {
                batch[unit * SHAPE_AND_COLOUR + SHAPE + k] = colours[index * 3 + k];
            }
        }
        if unit == 0 {
            live[0] = 0u32;
        }
        sync_cube();
        let mut k = 0usize;
        while k < count && open {
            let at = k * SHAPE_AND_COLOUR;
            let alpha = alpha_at(
                px - batch[at],
                py - batch[at + 1],
                batch[at + 2],
                batch[at + 3],
                batch[at + 4],
                batch[at + 5],
            );
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
        let out = (first_pixel + y * width + x) as usize;
        pictures[out] = r + transmittance * red;
        pictures[out + area] = g + transmittance * green;
        pictures[out + 2 * area] = b + transmittance * blue;
    }
}

/// Gradient of a tile to the colours of its splats: `slots` (`[pairs][3]`) gets `sum_pixels weight * gradient`, of
/// gradients to pictures `[views][3][height][width]`.
///
/// The units recompute their weights front to back for [`BATCH`] splats at a time and leave them in shared memory;
/// then [`SUMMERS`] units a splat each sum 16 pixels, and one unit a splat sums those.
#[cube(launch)]
pub fn splat_gradients(
    splats: &[f32],
    start: &[u32],
    list: &[u32],
    gradient: &[f32],
    slots: &mut [f32],
    first_pixel: u32,
    width: u32,
    height: u32,
) {
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
        let at = (first_pixel + y * width + x) as usize;
        for c in 0..3usize {
            pixels[unit * 3 + c] = gradient[at + c * area];
        }
    }
    let mut open = inside;
    let mut any_open = 1u32;
    let mut transmittance = 1.0f32;

    let mut base = start[tile] as usize;
    let end = start[tile + 1] as usize;
    while base < end && any_open == 1u32 {
        let count = min(end - base, BATCH);
        if unit < count {
            let index = list[base + unit] as usize;
            for k in 0..SHAPE {
                batch[unit * SHAPE + k] = splats[index * SPLAT_FLOATS + k];
            }
        }
        if unit == 0 {
            live[0] = 0u32;
        }
        sync_cube();
        for k in 0..count {
            let mut weight = 0.0f32;
            if open {
                let at = k * SHAPE;
                let alpha = alpha_at(
                    px - batch[at],
                    py - batch[at + 1],
                    batch[at + 2],
                    batch[at + 3],
                    batch[at + 4],
                    batch[at + 5],
                );
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
                slots[(base + unit) * 3 + c] = sum;
            }
        }
        any_open = workgroup_uniform_load(&live[0]);
        base += BATCH;
    }
    // Splats behind the last open pixel have no weight.
    let mut slot = base + unit;
    while slot < end {
        for c in 0..3usize {
            slots[slot * 3 + c] = 0.0f32;
        }
        slot += PIXELS;
    }
}

/// Sums each Gaussian's slots in ascending order: `out` (`[count][3]`).
#[cube(launch)]
pub fn sum_slots(slot_start: &[u32], slot_list: &[u32], slots: &[f32], out: &mut [f32], count: u32) {
    let i = ABSOLUTE_POS;
    if i < count as usize {
        let mut r = 0.0f32;
        let mut g = 0.0f32;
        let mut b = 0.0f32;
        let mut k = slot_start[i] as usize;
        let end = slot_start[i + 1] as usize;
        while k < end {
            let at = slot_list[k] as usize * 3;
            r += slots[at];
            g += slots[at + 1];
            b += slots[at + 2];
            k += 1;
        }
        out[i * 3] = r;
        out[i * 3 + 1] = g;
        out[i * 3 + 2] = b;
    }
}
