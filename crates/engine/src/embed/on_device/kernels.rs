//! CubeCL kernels of the optimisers: a unit a slot, as [`super::super::preconditioned_sgd`] and [`super::super::adam`] do it.
//! Sums have a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::super::preconditioned_sgd::MEAN_SQUARE;
use crate::launch::{CUBE, cube_of_layer, sum_of_cube, unit_of_layer};

const UNITS: usize = CUBE as usize;

/// Parts of the state of preconditioned SGD.
pub(super) const STATE: usize = 3;
const RUNNING: usize = 0;
const LARGEST: usize = 1;
const SCALE: usize = 2;

/// Sums of a penalty: squares of constant offsets, of all others, and sizes of gradients.
pub(super) const SUMS: usize = 3;

/// Adds a step along the gradient to the velocity of each slot; `energies` gets each cube's sum of squares over inverse
/// energies, from `first_cube` on.
#[cube(launch)]
pub fn accelerate(
    inverse: &[f32],
    gradient: &[f32],
    velocity: &mut [f32],
    energies: &mut [f32],
    first_cube: u32,
    dc: f32,
    rest: f32,
    momentum: f32,
    #[comptime] columns: usize,
) {
    let slot = unit_of_layer();
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut energy = 0.0f32;
    if slot < inverse.len() {
        let own = inverse[slot];
        let mut squares = 0.0f32;
        for k in 0..columns {
            let at = slot * columns + k;
            let mut share = rest;
            if k < 3 {
                share = dc;
            }
            let step = share * own * gradient[at];
            let moved = momentum * velocity[at] + (1.0f32 - momentum) * step;
            velocity[at] = moved;
            squares += moved * moved;
        }
        energy = squares / own;
    }
    let sum = sum_of_cube(energy, &mut shared);
    if UNIT_POS == 0 {
        energies[first_cube as usize + cube_of_layer()] = sum;
    }
}

/// One cube: the factor of the step from the energies of all cubes, and what is remembered of them, to `state`.
#[cube(launch)]
pub fn scale_of_step(energies: &[f32], state: &mut [f32], length: f32, pixels: f32) {
    let unit = UNIT_POS as usize;
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut own = 0.0f32;
    let mut at = unit;
    while at < energies.len() {
        own += energies[at];
        at += UNITS;
    }
    let energy = sum_of_cube(own, &mut shared) * MEAN_SQUARE / pixels;
    if unit == 0 {
        state[SCALE] = 0.0f32;
        if energy > 0.0f32 {
            let mut running = energy;
            let mut largest = state[LARGEST];
            if largest > 0.0f32 {
                running = 0.9f32 * state[RUNNING] + 0.1f32 * energy;
            }
            largest = max(largest, running);
            state[RUNNING] = running;
            state[LARGEST] = largest;
            state[SCALE] = length / f32::sqrt(max(largest, energy));
        }
    }
}

/// Moves offsets against the velocity.
#[cube(launch)]
pub fn advance(velocity: &[f32], state: &[f32], offsets: &mut [f32]) {
    let unit = unit_of_layer();
    if unit < offsets.len() {
        offsets[unit] -= state[SCALE] * velocity[unit];
    }
}

/// Each cube's sums over its slots, `[cubes][SUMS]`, from `first_cube` on.
#[cube(launch)]
pub fn sums_of_offsets(
    offsets: &[f32],
    gradient: &[f32],
    sums: &mut [f32],
    first_cube: u32,
    slots: u32,
    #[comptime] columns: usize,
) {
    let slot = unit_of_layer();
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut dc = 0.0f32;
    let mut rest = 0.0f32;
    let mut sizes = 0.0f32;
    if slot < slots as usize {
        for k in 0..columns {
            let offset = offsets[slot * columns + k];
            if k < 3 {
                dc += offset * offset;
            } else {
                rest += offset * offset;
            }
            sizes += f32::abs(gradient[slot * columns + k]);
        }
    }
    let dc = sum_of_cube(dc, &mut shared);
    let rest = sum_of_cube(rest, &mut shared);
    let sizes = sum_of_cube(sizes, &mut shared);
    if UNIT_POS == 0 {
        let at = (first_cube as usize + cube_of_layer()) * SUMS;
        sums[at] = dc;
        sums[at + 1] = rest;
        sums[at + 2] = sizes;
    }
}

/// One step of Adam for each slot; `corrections` (`[steps][2]`) are the factor of the mean and the divisor of the root after
/// so many steps.
#[cube(launch)]
pub fn adam_step(
    corrections: &[f32],
    gradient: &[f32],
    offsets: &mut [f32],
    mean: &mut [f32],
    square: &mut [f32],
    steps: &mut [u32],
    rate_dc: f32,
    rate_rest: f32,
    pull_dc: f32,
    pull_rest: f32,
    beta1: f32,
    beta2: f32,
    epsilon: f32,
    #[comptime] columns: usize,
    #[comptime] sparse: bool,
) {
    let slot = unit_of_layer();
    if slot < steps.len() {
        let mut moves = true;
        if sparse {
            moves = false;
            for k in 0..columns {
                if gradient[slot * columns + k] != 0.0f32 {
                    moves = true;
                }
            }
        }
        if moves {
            let done = steps[slot];
            steps[slot] = done + 1;
            let scale = corrections[2 * done as usize];
            let root_of = corrections[2 * done as usize + 1];
            for k in 0..columns {
                let at = slot * columns + k;
                let mut rate = rate_rest;
                let mut pull = pull_rest;
                if k < 3 {
                    rate = rate_dc;
                    pull = pull_dc;
                }
                let g = gradient[at] + pull * offsets[at];
                let m = beta1 * mean[at] + (1.0f32 - beta1) * g;
                let s = beta2 * square[at] + (1.0f32 - beta2) * g * g;
                mean[at] = m;
                square[at] = s;
                let root = f32::sqrt(s) / root_of + epsilon;
                offsets[at] -= rate * scale * m / root;
            }
        }
    }
}
