//! CubeCL kernel that draws views: a cube of 16 x 16 units a tile, a unit a pixel.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::batch::{BACKGROUND, FIRST_CHUNK, FIRST_COLOUR, PICTURE, SHAPE, SPLATS, TILE_LIST, TILE_START};
use super::kernels::{PIXELS, alpha_at, field, first_chunk, float_field};
use crate::splat::composite::TRANSMITTANCE_MIN;
use crate::splat::project::ALPHA_MIN;
use crate::splat::tiles::TILE;

/// A splat's shape and colour.
const SHAPE_AND_COLOUR: usize = SHAPE + 3;

/// Draws a tile: `pictures` (`[views][3][height][width]`) from the tile's list, front to back, with the group's `colours`.
///
/// If `twice`, also `others` with `other_colours`, since the weights are the same. If `keep`, leaves in `lights`
/// (`[chunks of all views][256]`) what light each pixel has left before each chunk of the list, 0 where it takes no more: the
/// gradients begin there ([`super::gradients`]).
#[cube(launch)]
pub fn composite(
    words: &[u32],
    table: &[u32],
    colours: &[f32],
    other_colours: &[f32],
    pictures: &mut [f32],
    others: &mut [f32],
    lights: &mut [f32],
    width: u32,
    height: u32,
    #[comptime] twice: bool,
    #[comptime] keep: bool,
) {
    let view = CUBE_POS_Z as usize;
    let splats = field(table, view, SPLATS);
    let list = field(table, view, TILE_LIST);
    let first_colour = field(table, view, FIRST_COLOUR);
    let unit = UNIT_POS as usize;
    let tile = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize;
    let x = CUBE_POS_X * TILE + UNIT_POS_X;
    let y = CUBE_POS_Y * TILE + UNIT_POS_Y;
    let inside = x < width && y < height;
    let px = f32::cast_from(x);
    let py = f32::cast_from(y);

    let mut batch = Shared::<[f32]>::new_slice(PIXELS * SHAPE_AND_COLOUR);
    let mut second = Shared::<[f32]>::new_slice(comptime!(if twice { PIXELS * 3 } else { 1 }));
    let mut live = Shared::<[u32]>::new_slice(1usize);
    let mut open = inside;
    let mut any_open = 1u32;
    let mut transmittance = 1.0f32;
    let mut r = 0.0f32;
    let mut g = 0.0f32;
    let mut b = 0.0f32;
    let mut other_r = 0.0f32;
    let mut other_g = 0.0f32;
    let mut other_b = 0.0f32;

    let start = field(table, view, TILE_START);
    let mut base = words[start + tile] as usize;
    let end = words[start + tile + 1] as usize;
    let mut light = (field(table, view, FIRST_CHUNK) + first_chunk(base, tile)) * PIXELS + unit;
    while base < end && any_open == 1u32 {
        let count = min(end - base, PIXELS);
        if comptime!(keep) {
            let mut left = 0.0f32;
            if open {
                left = transmittance;
            }
            lights[light] = left;
            light += PIXELS;
        }
        if unit < count {
            let index = words[list + base + unit] as usize;
            for k in 0..SHAPE {
                batch[unit * SHAPE_AND_COLOUR + k] = f32::reinterpret(words[splats + index * SHAPE + k]);
            }
            for k in 0..3usize {
                batch[unit * SHAPE_AND_COLOUR + SHAPE + k] = colours[(first_colour + index) * 3 + k];
                if comptime!(twice) {
                    second[unit * 3 + k] = other_colours[(first_colour + index) * 3 + k];
                }
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
                    if comptime!(twice) {
                        other_r += weight * second[3 * k];
                        other_g += weight * second[3 * k + 1];
                        other_b += weight * second[3 * k + 2];
                    }
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
    if comptime!(keep) {
        // Chunks behind the last open pixel.
        while base < end {
            lights[light] = 0.0f32;
            light += PIXELS;
            base += PIXELS;
        }
    }
    if inside {
        let area = (width * height) as usize;
        let out = field(table, view, PICTURE) * 3 * area + (y * width + x) as usize;
        let back_r = transmittance * float_field(table, view, BACKGROUND);
        let back_g = transmittance * float_field(table, view, BACKGROUND + 1);
        let back_b = transmittance * float_field(table, view, BACKGROUND + 2);
        pictures[out] = r + back_r;
        pictures[out + area] = g + back_g;
        pictures[out + 2 * area] = b + back_b;
        if comptime!(twice) {
            others[out] = other_r + back_r;
            others[out + area] = other_g + back_g;
            others[out + 2 * area] = other_b + back_b;
        }
    }
}
