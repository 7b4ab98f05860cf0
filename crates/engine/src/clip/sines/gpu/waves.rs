//! CubeCL kernels of sines and of their gradients to pixels. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use cubecl::prelude::*;

use super::CHUNK;
use super::layout::{Sides, chunks_of, place_of};
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

/// Means of squares of pixels at all scales, a unit a square: of `pictures` (`[views][3][height][width]`).
#[cube(launch)]
pub fn means_of_squares(
    pictures: &[f32],
    squares: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    #[comptime] sides: Sides,
) {
    let unit = ABSOLUTE_POS;
    if 3 * unit < squares.len() {
        let (width, height) = (width as usize, height as usize);
        let at = place_of(unit, views as usize, width, height, sides, false);
        let columns = width / at.side;
        let corner = at.within / columns * at.side * width + at.within % columns * at.side;
        let pixels = f32::cast_from((at.side * at.side) as u32);
        for channel in 0..3usize {
            let first = (at.view * 3 + channel) * width * height + corner;
            let mut sum = 0.0f32;
            for down in 0..at.side {
                for along in 0..at.side {
                    sum += pictures[first + down * width + along];
                }
            }
            squares[3 * at.first + channel * at.squares + at.within] = sum / pixels;
        }
    }
}

/// A unit for each chunk of squares and wave of its scale: `sums` is `[chunks][waves]`, of `filters` (`[scales][waves][3]`) and
/// `phases` (`[scales][waves]`). Rarities of squares weigh them if `weighted`, and are not read otherwise.
#[cube(launch)]
pub fn chunk_sums(
    squares: &[f32],
    filters: &[f32],
    phases: &[f32],
    rarity: &[f32],
    sums: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    #[comptime] sides: Sides,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    if unit < sums.len() {
        let waves = phases.len() / comptime!(sides.count);
        let chunk = unit / waves;
        let at = place_of(chunk, views as usize, width as usize, height as usize, sides, true);
        let wave = at.scale * waves + unit % waves;
        let red = filters[3 * wave];
        let green = filters[3 * wave + 1];
        let blue = filters[3 * wave + 2];
        let phase = phases[wave];
        let mut square = at.within * CHUNK;
        let end = min(square + CHUNK, at.squares);
        let mut sum = 0.0f32;
        while square < end {
            let first = 3 * at.first + square;
            let angle = red * squares[first]
                + green * squares[first + at.squares]
                + blue * squares[first + 2 * at.squares]
                + phase;
            let mut value = sine(angle);
            if weighted {
                value *= rarity[at.first + square];
            }
            sum += value;
            square += 1;
        }
        sums[unit] = sum;
    }
}

/// A unit for each view, scale and wave: the mean over squares, `[views][scales][waves]`, from sums and the `totals` (`[chunks]`)
/// of their weights, which are not read unless `weighted`; and one over the sum of all weights to `shares` (`[scales][views]`).
#[cube(launch)]
pub fn means_of_chunks(
    sums: &[f32],
    totals: &[f32],
    means: &mut [f32],
    shares: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    #[comptime] sides: Sides,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    if unit < means.len() {
        let views = views as usize;
        let waves = means.len() / views / comptime!(sides.count);
        let wave = unit % waves;
        let scale = unit / waves % comptime!(sides.count);
        let view = unit / waves / comptime!(sides.count);
        let (first, count, squares) = chunks_of(scale, view, views, width as usize, height as usize, sides);
        let mut sum = 0.0f32;
        let mut total = 0.0f32;
        for chunk in first..first + count {
            sum += sums[chunk * waves + wave];
            if weighted {
                total += totals[chunk];
            }
        }
        if !weighted {
            total = f32::cast_from(squares as u32);
        }
        means[unit] = sum / total;
        if wave == 0 {
            shares[scale * views + view] = 1.0f32 / total;
        }
    }
}

/// A unit a square: the gradient to its three colours, as squares lie, from that to means.
#[cube(launch)]
pub fn to_squares(
    squares: &[f32],
    filters: &[f32],
    phases: &[f32],
    rarity: &[f32],
    shares: &[f32],
    gradient: &[f32],
    out: &mut [f32],
    views: u32,
    width: u32,
    height: u32,
    #[comptime] sides: Sides,
    #[comptime] weighted: bool,
) {
    let unit = ABSOLUTE_POS;
    if 3 * unit < squares.len() {
        let views = views as usize;
        let at = place_of(unit, views, width as usize, height as usize, sides, false);
        let waves = phases.len() / comptime!(sides.count);
        let first = 3 * at.first + at.within;
        let r = squares[first];
        let g = squares[first + at.squares];
        let b = squares[first + 2 * at.squares];
        let mut share = shares[at.scale * views + at.view];
        if weighted {
            share *= rarity[at.first + at.within];
        }
        let mut to_r = 0.0f32;
        let mut to_g = 0.0f32;
        let mut to_b = 0.0f32;
        for own in 0..waves {
            let wave = at.scale * waves + own;
            let red = filters[3 * wave];
            let green = filters[3 * wave + 1];
            let blue = filters[3 * wave + 2];
            let angle = red * r + green * g + blue * b + phases[wave];
            let slope = cosine(angle) * gradient[at.view * phases.len() + wave] * share;
            to_r += red * slope;
            to_g += green * slope;
            to_b += blue * slope;
        }
        out[first] = to_r;
        out[first + at.squares] = to_g;
        out[first + 2 * at.squares] = to_b;
    }
}

/// A unit for each number of pictures: the gradient to it, from those to the squares that it is in.
#[cube(launch)]
pub fn to_pixels(of_squares: &[f32], out: &mut [f32], views: u32, width: u32, height: u32, #[comptime] sides: Sides) {
    let unit = ABSOLUTE_POS;
    if unit < out.len() {
        let (width, height) = (width as usize, height as usize);
        let plane = unit / (width * height);
        let row = unit / width % height;
        let column = unit % width;
        let mut sum = 0.0f32;
        let mut first = 0usize;
        #[unroll]
        for s in 0..comptime!(sides.count) {
            let side = comptime!(sides.side(s));
            let columns = width / side;
            let rows = height / side;
            // What is left of a picture beside the last squares is in none.
            if row / side < rows && column / side < columns {
                let at = first + plane * rows * columns + row / side * columns + column / side;
                sum += of_squares[at] / comptime!((side * side) as f32);
            }
            first += 3 * views as usize * rows * columns;
        }
        out[unit] = sum;
    }
}
