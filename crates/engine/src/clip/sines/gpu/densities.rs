//! CubeCL kernels of weights by how rare a colour is; see [`crate::clip::sines::density`]. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::CHUNK;
use crate::clip::sines::density::{CORNERS, GRID, LEAST};
use crate::launch::{cube_of_layer, sum_of_cube};

/// A channel's place on the grid of colours.
#[cube]
fn place(value: f32) -> f32 {
    f32::clamp(value - LEAST, 0.0f32, (CORNERS - 1) as f32)
}

/// The corner at or below a place, and not the last.
#[cube]
fn below(place: f32) -> usize {
    min(place as usize, CORNERS - 2)
}

/// What a corner of the grid has of a colour in one channel.
#[cube]
fn share(place: f32, corner: usize) -> f32 {
    max(1.0f32 - f32::abs(place - corner as f32), 0.0f32)
}

/// A unit for each picture, chunk of pixels and corner of red and green: what its corners of blue have of the chunk's pixels,
/// `[views][chunks][GRID]`.
#[cube(launch)]
pub fn chunk_counts(pictures: &[f32], counts: &mut [f32], pixels: u32, chunks: u32) {
    let unit = ABSOLUTE_POS;
    if unit * CORNERS < counts.len() {
        let red = unit / CORNERS % CORNERS;
        let green = unit % CORNERS;
        let chunk = unit / (CORNERS * CORNERS) % chunks as usize;
        let picture = unit / (CORNERS * CORNERS) / chunks as usize * 3 * pixels as usize;
        let mut pixel = chunk * CHUNK;
        let end = min(pixel + CHUNK, pixels as usize);
        let mut sums = Array::<f32>::new(CORNERS);
        while pixel < end {
            let at = picture + pixel;
            let both = share(place(pictures[at]), red) * share(place(pictures[at + pixels as usize]), green);
            let blue = place(pictures[at + 2 * pixels as usize]);
            #[unroll]
            for corner in 0..CORNERS {
                sums[corner] += both * share(blue, corner);
            }
            pixel += 1;
        }
        #[unroll]
        for corner in 0..CORNERS {
            counts[unit * CORNERS + corner] = sums[corner];
        }
    }
}

/// A cube for each picture and chunk, a unit a pixel: its density to the power of minus `equalization`, and the chunk's sum of
/// that.
#[cube(launch)]
pub fn rarities(
    pictures: &[f32],
    grid: &[f32],
    rarity: &mut [f32],
    totals: &mut [f32],
    pixels: u32,
    chunks: u32,
    equalization: f32,
) {
    let cube = cube_of_layer();
    let view = cube / chunks as usize;
    let pixel = cube % chunks as usize * CHUNK + UNIT_POS as usize;
    let mut shared = Shared::<[f32]>::new_slice(CHUNK);
    let mut found = 0.0f32;
    if pixel < pixels as usize && cube < totals.len() {
        let at = view * 3 * pixels as usize + pixel;
        let red = place(pictures[at]);
        let green = place(pictures[at + pixels as usize]);
        let blue = place(pictures[at + 2 * pixels as usize]);
        let mut density = 0.0f32;
        // All other corners have no share of it.
        for corner in 0..8usize {
            let r = below(red) + corner / 4;
            let g = below(green) + corner / 2 % 2;
            let b = below(blue) + corner % 2;
            density +=
                grid[view * GRID + (r * CORNERS + g) * CORNERS + b] * share(red, r) * share(green, g) * share(blue, b);
        }
        found = f32::powf(max(density, 0.125f32), -equalization);
        rarity[view * pixels as usize + pixel] = found;
    }
    let sum = sum_of_cube(found, &mut shared);
    if UNIT_POS == 0 && cube < totals.len() {
        totals[cube] = sum;
    }
}

/// A unit for each number of each picture: its sum over chunks, in order.
#[cube(launch)]
pub fn sums_of_chunks(counts: &[f32], sums: &mut [f32], numbers: u32, chunks: u32) {
    let unit = ABSOLUTE_POS;
    if unit < sums.len() {
        let view = unit / numbers as usize;
        let number = unit % numbers as usize;
        let mut sum = 0.0f32;
        for chunk in 0..chunks as usize {
            sum += counts[(view * chunks as usize + chunk) * numbers as usize + number];
        }
        sums[unit] = sum;
    }
}
