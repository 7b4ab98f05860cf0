//! CubeCL kernels of weights by how rare a colour is; see [`crate::clip::sines::density`]. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::CHUNK;
use super::layout::{Sides, chunks_of, place_of};
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

/// A unit for each chunk of squares and corner of red and green: what its corners of blue have of the chunk, `[chunks][GRID]`.
#[cube(launch)]
pub fn chunk_counts(
    squares: &[f32],
    counts: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    #[comptime] sides: Sides,
) {
    let unit = ABSOLUTE_POS;
    if unit * CORNERS < counts.len() {
        let red = unit / CORNERS % CORNERS;
        let green = unit % CORNERS;
        let chunk = unit / (CORNERS * CORNERS);
        let at = place_of(chunk, views as usize, width as usize, height as usize, sides, true);
        let mut square = at.within * CHUNK;
        let end = min(square + CHUNK, at.squares);
        let mut sums = Array::<f32>::new(CORNERS);
        while square < end {
            let first = 3 * at.first + square;
            let both = share(place(squares[first]), red) * share(place(squares[first + at.squares]), green);
            let blue = place(squares[first + 2 * at.squares]);
            #[unroll]
            for corner in 0..CORNERS {
                sums[corner] += both * share(blue, corner);
            }
            square += 1;
        }
        #[unroll]
        for corner in 0..CORNERS {
            counts[unit * CORNERS + corner] = sums[corner];
        }
    }
}

/// A unit for each corner of each view and scale: the sum of its chunks, in order, `[scales][views][GRID]`.
#[cube(launch)]
pub fn sums_of_chunks(
    counts: &[f32],
    grids: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    #[comptime] sides: Sides,
) {
    let unit = ABSOLUTE_POS;
    if unit < grids.len() {
        let views = views as usize;
        let of_view = unit / GRID;
        let (first, count, _) = chunks_of(
            of_view / views,
            of_view % views,
            views,
            width as usize,
            height as usize,
            sides,
        );
        let mut sum = 0.0f32;
        for chunk in first..first + count {
            sum += counts[chunk * GRID + unit % GRID];
        }
        grids[unit] = sum;
    }
}

/// A cube for each chunk, a unit a square: its density to the power of minus `equalization`, and the chunk's sum of that.
#[cube(launch)]
pub fn rarities(
    squares: &[f32],
    grids: &[f32],
    rarity: &mut [f32],
    totals: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    equalization: f32,
    #[comptime] sides: Sides,
) {
    let chunk = cube_of_layer();
    let mut shared = Shared::<[f32]>::new_slice(CHUNK);
    let mut found = 0.0f32;
    if chunk < totals.len() {
        let at = place_of(chunk, views as usize, width as usize, height as usize, sides, true);
        let square = at.within * CHUNK + UNIT_POS as usize;
        if square < at.squares {
            let first = 3 * at.first + square;
            let red = place(squares[first]);
            let green = place(squares[first + at.squares]);
            let blue = place(squares[first + 2 * at.squares]);
            let grid = (at.scale * views as usize + at.view) * GRID;
            let mut density = 0.0f32;
            // All other corners have no share of it.
            for corner in 0..8usize {
                let r = below(red) + corner / 4;
                let g = below(green) + corner / 2 % 2;
                let b = below(blue) + corner % 2;
                let has = grids[grid + (r * CORNERS + g) * CORNERS + b];
                density += has * share(red, r) * share(green, g) * share(blue, b);
            }
            found = f32::powf(max(density, 0.125f32), -equalization);
            rarity[at.first + square] = found;
        }
    }
    let sum = sum_of_cube(found, &mut shared);
    if UNIT_POS == 0 && chunk < totals.len() {
        totals[chunk] = sum;
    }
}
