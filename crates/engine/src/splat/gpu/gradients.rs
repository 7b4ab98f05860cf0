//! CubeCL kernel that takes gradients to pictures back to the splats that were drawn.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::batch::{FIRST_CHUNK, FIRST_SLOT, PICTURE, SHAPE, SPLATS, TILE_LIST, TILE_START};
use super::kernels::{PIXELS, alpha_at, field, first_chunk};
use crate::splat::composite::TRANSMITTANCE_MIN;
use crate::splat::project::ALPHA_MIN;
use crate::splat::tiles::TILE;

/// Splats whose weights are in shared memory at a time: 16 x 256 floats are 16 KiB.
const BATCH: usize = 16;
/// Units that sum one splat's 256 products.
const SUMMERS: usize = PIXELS / BATCH;

/// Gradient of a chunk of a tile's list to the colours of its splats: the group's `slots` (`[pairs][3]`) get
/// `sum_pixels weight * gradient`, of gradients to pictures `[views][3][height][width]`. A cube a chunk: the longest list
/// would have all others wait.
///
/// The units recompute their weights front to back from the chunk's `lights` on, for [`BATCH`] splats at a time, and leave
/// them in shared memory; then [`SUMMERS`] units a splat each sum 16 pixels, and one unit a splat sums those.
#[cube(launch)]
pub fn splat_gradients(
    words: &[u32],
    table: &[u32],
    gradient: &[f32],
    lights: &[f32],
    slots: &mut [f32],
    width: u32,
    height: u32,
    tile_columns: u32,
    tiles: u32,
) {
    let view = CUBE_POS_Z as usize;
    let splats = field(table, view, SPLATS);
    let list = field(table, view, TILE_LIST);
    let first_slot = field(table, view, FIRST_SLOT);
    let start = field(table, view, TILE_START);
    let unit = UNIT_POS as usize;
    let chunk = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize;
    // The last tile whose chunks begin at or before this one.
    let mut tile = 0usize;
    let mut beyond = tiles as usize;
    while tile + 1 < beyond {
        let middle = (tile + beyond) / 2;
        if first_chunk(words[start + middle] as usize, middle) <= chunk {
            tile = middle;
        } else {
            beyond = middle;
        }
    }
    let from = words[start + tile] as usize;
    let of_tile = words[start + tile + 1] as usize;
    // Behind the tile's last chunk there is nothing to do; every unit of the cube knows.
    let mut base = min(from + (chunk - first_chunk(from, tile)) * PIXELS, of_tile);
    let end = min(base + PIXELS, of_tile);

    let x = tile as u32 % tile_columns * TILE + UNIT_POS_X;
    let y = tile as u32 / tile_columns * TILE + UNIT_POS_Y;
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
    let mut transmittance = 0.0f32;
    if inside && base < end {
        let area = (width * height) as usize;
        let at = field(table, view, PICTURE) * 3 * area + (y * width + x) as usize;
        for c in 0..3usize {
            pixels[unit * 3 + c] = gradient[at + c * area];
        }
        transmittance = lights[(field(table, view, FIRST_CHUNK) + chunk) * PIXELS + unit];
    }
    let mut open = transmittance > 0.0f32;
    if unit == 0 {
        live[0] = 0u32;
    }
    sync_cube();
    if open {
        live[0] = 1u32;
    }
    let mut any_open = workgroup_uniform_load(&live[0]);
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
