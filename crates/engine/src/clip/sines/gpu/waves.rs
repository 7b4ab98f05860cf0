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

/// A unit for each picture, chunk of pixels and wave: `sums` is `[views][chunks][waves]`. Rarities of pixels are
/// `[views][pixels]`, and not read unless `weighted`.
#[cube(launch)]
pub fn chunk_sums(
    pictures: &[f32],
    filters: &[f32],
    phases: &[f32],
    rarity: &[f32],
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
                value *= rarity[view * pixels as usize + pixel];
            }
            sum += value;
            pixel += 1;
        }
        sums[unit] = sum;
    }
}

/// A unit for each picture and wave: the mean over pixels, from sums and the `totals` (`[views][chunks]`) of their weights, which
/// are not read unless `weighted`; and one over the sum of all weights to `shares` (`[views]`).
#[cube(launch)]
pub fn means_of_chunks(
    sums: &[f32],
    totals: &[f32],
    means: &mut [f32],
    shares: &mut [f32],
    waves: u32,
    pixels: u32,
    chunks: u32,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    if unit < means.len() {
        let view = unit / waves as usize;
        let wave = unit % waves as usize;
        let mut sum = 0.0f32;
        let mut total = 0.0f32;
        for chunk in 0..chunks as usize {
            let at = view * chunks as usize + chunk;
            sum += sums[at * waves as usize + wave];
            if weighted {
                total += totals[at];
            }
        }
        if !weighted {
            total = f32::cast_from(pixels);
        }
        means[unit] = sum / total;
        if wave == 0 {
            shares[view] = 1.0f32 / total;
        }
    }
}

/// Means of squares of `side` pixels of planes: a unit a square, `squares` is `[planes][rows][columns]`.
#[cube(launch)]
pub fn means_of_squares(planes: &[f32], squares: &mut [f32], width: u32, height: u32, side: u32) {
    let unit = ABSOLUTE_POS;
    if unit < squares.len() {
        let columns = (width / side) as usize;
        let rows = (height / side) as usize;
        let plane = unit / (rows * columns) * (width * height) as usize;
        let top = unit / columns % rows * side as usize;
        let left = unit % columns * side as usize;
        let mut sum = 0.0f32;
        for down in 0..side as usize {
            for along in 0..side as usize {
                sum += planes[plane + (top + down) * width as usize + left + along];
            }
        }
        squares[unit] = sum / f32::cast_from(side * side);
    }
}

/// A unit for each picture and square of `side` pixels: the gradient to the three colours of its pixels. What is left of a picture
/// beside the last squares has none.
#[cube(launch)]
pub fn to_pixels(
    squares: &[f32],
    filters: &[f32],
    phases: &[f32],
    rarity: &[f32],
    shares: &[f32],
    gradient: &[f32],
    out: &mut [f32],
    width: u32,
    height: u32,
    side: u32,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    let columns = (width / side) as usize;
    let rows = (height / side) as usize;
    if 3 * unit < squares.len() {
        let waves = phases.len();
        let view = unit / (rows * columns);
        let square = unit % (rows * columns);
        let at = view * 3 * rows * columns + square;
        let r = squares[at];
        let g = squares[at + rows * columns];
        let b = squares[at + 2 * rows * columns];
        let mut share = shares[view] / f32::cast_from(side * side);
        if weighted {
            share *= rarity[unit];
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
        let row = square / columns;
        let column = square % columns;
        let mut down = side as usize;
        let mut along = side as usize;
        if row + 1 == rows {
            down = height as usize - row * side as usize;
        }
        if column + 1 == columns {
            along = width as usize - column * side as usize;
        }
        let area = (width * height) as usize;
        let first = view * 3 * area + row * side as usize * width as usize + column * side as usize;
        for y in 0..down {
            for x in 0..along {
                let pixel = first + y * width as usize + x;
                let mut inside = 0.0f32;
                if x < side as usize && y < side as usize {
                    inside = 1.0f32;
                }
                out[pixel] = inside * to_r;
                out[pixel + area] = inside * to_g;
                out[pixel + 2 * area] = inside * to_b;
            }
        }
    }
}
