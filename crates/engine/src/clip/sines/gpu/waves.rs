//! CubeCL kernels of sines and of their gradients to pixels. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::CHUNK;
use crate::clip::sines::TURN;
use crate::clip::sines::kernel::SINE;

/// One over a turn.
const TURNS: f32 = std::f32::consts::FRAC_1_PI / 2.0;

/// `angle` less whole turns, in turns: from -1/2 to 1/2.
#[cube]
fn turns(angle: f32) -> f32 {
    let whole = f32::round(angle * TURNS);
    (angle - whole * TURN[0] - whole * TURN[1]) * TURNS
}

/// The sine of at most half a turn, by the same polynomial as on the CPU: a device's own may be slow, and differs from
/// device to device.
#[cube]
fn sine_of(turns: f32) -> f32 {
    let square = turns * turns;
    let high = square * (square * SINE[5] + SINE[4]) + SINE[3];
    turns * (square * (square * (square * high + SINE[2]) + SINE[1]) + SINE[0])
}

/// The sine of `angle`, in radians.
#[cube]
fn sine(angle: f32) -> f32 {
    sine_of(turns(angle))
}

/// The cosine of `angle`: the sine a quarter turn on.
#[cube]
fn cosine(angle: f32) -> f32 {
    let on = turns(angle) + 0.25f32;
    sine_of(on - f32::round(on))
}

/// A unit for each picture, chunk of pixels and wave: `sums` is `[views][chunks][waves]`. Weights are `[views][pixels]`,
/// and not read unless `weighted`.
#[cube(launch)]
pub fn chunk_sums(
    pictures: &[f32],
    filters: &[f32],
    phases: &[f32],
    weights: &[f32],
    sums: &mut [f32],
    pixels: u32,
    chunks: u32,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    if unit < sums.len() {
        let waves = phases.len();
        let wave = unit % waves;
        let chunk = unit / waves % chunks as usize;
        let view = unit / waves / chunks as usize;
        let picture = view * 3 * pixels as usize;
        let red = filters[3 * wave];
        let green = filters[3 * wave + 1];
        let blue = filters[3 * wave + 2];
        let phase = phases[wave];
        let mut pixel = chunk * CHUNK;
        let end = min(pixel + CHUNK, pixels as usize);
        let mut sum = 0.0f32;
        while pixel < end {
            let at = picture + pixel;
            let angle = red * pictures[at]
                + green * pictures[at + pixels as usize]
                + blue * pictures[at + 2 * pixels as usize]
                + phase;
            let mut value = sine(angle);
            if weighted {
                value *= weights[view * pixels as usize + pixel];
            }
            sum += value;
            pixel += 1;
        }
        sums[unit] = sum;
    }
}

/// A unit for each picture and wave: the mean over chunks, in order.
#[cube(launch)]
pub fn mean_of_chunks(sums: &[f32], means: &mut [f32], waves: u32, chunks: u32, scale: f32) {
    let unit = ABSOLUTE_POS;
    if unit < means.len() {
        let view = unit / waves as usize;
        let wave = unit % waves as usize;
        let mut sum = 0.0f32;
        for chunk in 0..chunks as usize {
            sum += sums[(view * chunks as usize + chunk) * waves as usize + wave];
        }
        means[unit] = sum * scale;
    }
}

/// A unit for each picture and pixel: the gradient to its three colours.
#[cube(launch)]
pub fn to_pixels(
    pictures: &[f32],
    filters: &[f32],
    phases: &[f32],
    weights: &[f32],
    gradient: &[f32],
    out: &mut [f32],
    pixels: u32,
    scale: f32,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    if 3 * unit < out.len() {
        let waves = phases.len();
        let view = unit / pixels as usize;
        let at = view * 3 * pixels as usize + unit % pixels as usize;
        let r = pictures[at];
        let g = pictures[at + pixels as usize];
        let b = pictures[at + 2 * pixels as usize];
        let mut share = scale;
        if weighted {
            share = weights[unit];
        }
        let mut to_r = 0.0f32;
        let mut to_g = 0.0f32;
        let mut to_b = 0.0f32;
        for wave in 0..waves {
            let red = filters[3 * wave];
            let green = filters[3 * wave + 1];
            let blue = filters[3 * wave + 2];
            let angle = red * r + green * g + blue * b + phases[wave];
            let slope = cosine(angle) * gradient[view * waves + wave] * share;
            to_r += red * slope;
            to_g += green * slope;
            to_b += blue * slope;
        }
        out[at] = to_r;
        out[at + pixels as usize] = to_g;
        out[at + 2 * pixels as usize] = to_b;
    }
}
