//! What the CubeCL kernels of the GPU rasteriser share, and the smaller ones: views put side by side, and the sum over slots.
//!
//! Kernels use nothing that lavapipe lacks: no subgroup operations, no float atomics, under 24 KiB of shared memory. Every sum
//! has a fixed order, so results repeat to the byte. Views of a group are drawn side by side: a view a layer of cubes, its
//! words found by the group's table ([`super::batch`]).
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::batch::{FIELDS, FIRST_COLOUR, FIRST_SLOT, SLOT_LIST, SLOT_START, VISIBLE};
use crate::launch::unit_of_layer;
use crate::splat::composite::ALPHA_MAX;
use crate::splat::tiles;

/// Pixels of a tile, and splats of a chunk of its list.
pub(super) const PIXELS: usize = tiles::TILE_PIXELS;
/// Parts that [`append`] takes at once.
pub(super) const PARTS: usize = 4;

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

/// Copies up to [`PARTS`] parts to `words`, each from its place on: a part a layer of cubes.
#[cube(launch)]
pub fn append(
    first: &[u32],
    second: &[u32],
    third: &[u32],
    fourth: &[u32],
    words: &mut [u32],
    at_first: u32,
    at_second: u32,
    at_third: u32,
    at_fourth: u32,
) {
    let unit = unit_of_layer();
    if CUBE_POS_Z == 0 {
        if unit < first.len() {
            words[at_first as usize + unit] = first[unit];
        }
    } else if CUBE_POS_Z == 1 {
        if unit < second.len() {
            words[at_second as usize + unit] = second[unit];
        }
    } else if CUBE_POS_Z == 2 {
        if unit < third.len() {
            words[at_third as usize + unit] = third[unit];
        }
    } else if unit < fourth.len() {
        words[at_fourth as usize + unit] = fourth[unit];
    }
}

/// Opacity at a pixel `px`, `py` of the splat whose shape is in `batch` from `at` on; see [`crate::splat::Splat2d`] for the
/// formula.
#[cube]
pub(super) fn alpha_at(px: f32, py: f32, batch: &Shared<[f32]>, at: usize) -> f32 {
    let dx = px - batch[at];
    let dy = py - batch[at + 1];
    let u = (dx - batch[at + 3] * dy) * batch[at + 2];
    let v = dy * batch[at + 4];
    let power = -0.5f32 * (u * u + v * v);
    min(batch[at + 5] * f32::exp(max(power, -80.0f32)), ALPHA_MAX)
}

/// Where a tile's list is cut into chunks of [`PIXELS`] splats: the number of its first chunk among those of its view.
/// `start` is where its list begins. No two chunks of a view have one number, and there are at most [`chunks_of_view`].
#[cube]
pub(super) fn first_chunk(start: usize, tile: usize) -> usize {
    start / PIXELS + tile
}

/// Room for the chunks of a view of so many tiles and (Gaussian, tile) pairs.
pub(super) fn chunks_of_view(tiles: usize, pairs: usize) -> usize {
    pairs / PIXELS + tiles
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
