//! Mean sines on the GPU: CubeCL kernels on burn's buffers. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::ops::ModuleOps;
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::density::{CORNERS, GRID, LEAST};
use super::kernel::SINE;
use super::{FloatTensor, MeanSines, TURN, WeightedSines};
use crate::launch::{empty_tensor, grid_of};

/// Units of a cube.
const CUBE: u32 = 64;
/// Pixels that one unit adds up.
const CHUNK: usize = 256;

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
fn chunk_sums(
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
fn mean_of_chunks(sums: &[f32], means: &mut [f32], waves: u32, chunks: u32, scale: f32) {
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
fn to_pixels(
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
fn chunk_counts(pictures: &[f32], counts: &mut [f32], pixels: u32, chunks: u32) {
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

/// A unit for each picture and pixel: its density to the power of minus `equalization`.
#[cube(launch)]
fn rarities(pictures: &[f32], grid: &[f32], out: &mut [f32], pixels: u32, equalization: f32) {
    let unit = ABSOLUTE_POS;
    if unit < out.len() {
        let view = unit / pixels as usize;
        let at = view * 3 * pixels as usize + unit % pixels as usize;
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
        out[unit] = f32::powf(max(density, 0.125f32), -equalization);
    }
}

/// A unit for each picture and chunk: the sum of its pixels.
#[cube(launch)]
fn chunk_totals(values: &[f32], totals: &mut [f32], pixels: u32, chunks: u32) {
    let unit = ABSOLUTE_POS;
    if unit < totals.len() {
        let view = unit / chunks as usize;
        let mut pixel = unit % chunks as usize * CHUNK;
        let end = min(pixel + CHUNK, pixels as usize);
        let mut sum = 0.0f32;
        while pixel < end {
            sum += values[view * pixels as usize + pixel];
            pixel += 1;
        }
        totals[unit] = sum;
    }
}

/// A unit for each picture and pixel: its share of the sum of all.
#[cube(launch)]
fn shares_of_all(values: &[f32], totals: &[f32], out: &mut [f32], pixels: u32, chunks: u32) {
    let unit = ABSOLUTE_POS;
    if unit < out.len() {
        let view = unit / pixels as usize;
        let mut sum = 0.0f32;
        for chunk in 0..chunks as usize {
            sum += totals[view * chunks as usize + chunk];
        }
        out[unit] = values[unit] / sum;
    }
}

impl MeanSines for Cube {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
        equalization: f32,
    ) -> FloatTensor<Self> {
        let weights = Self::weights(pictures.clone(), side, equalization);
        Self::sums(pictures, filters, phases, weights, side)
    }
}

impl WeightedSines for Cube {
    fn weights(pictures: FloatTensor<Self>, side: usize, equalization: f32) -> Option<FloatTensor<Self>> {
        if equalization == 0.0 {
            return None;
        }
        let pictures = into_contiguous(averaged(pictures, side));
        let shape = pictures.shape();
        let (views, pixels) = (shape[0], shape[2] * shape[3]);
        let chunks = pixels.div_ceil(CHUNK);
        let client = pictures.client.clone();
        let new = |shape: &[usize]| empty_tensor(&pictures, Shape::from(shape.to_vec()));
        let counts = new(&[views, chunks, GRID]);
        let grid_of_colours = new(&[views, GRID]);
        let rarity = new(&[views, pixels]);
        let totals = new(&[views, chunks]);
        let weights = new(&[views, pixels]);
        let (pixels, chunks) = (pixels as u32, chunks as u32);
        let arg = |tensor: &CubeTensor| tensor.clone().into_buffer_arg();
        let (count, dim) = grid_of(counts.shape().num_elements() / CORNERS, 1, CUBE);
        chunk_counts::launch(&client, count, dim, arg(&pictures), arg(&counts), pixels, chunks);
        let (count, dim) = grid_of(views * GRID, 1, CUBE);
        mean_of_chunks::launch(
            &client,
            count,
            dim,
            arg(&counts),
            arg(&grid_of_colours),
            GRID as u32,
            chunks,
            1.0,
        );
        let (count, dim) = grid_of(views * pixels as usize, 1, CUBE);
        rarities::launch(
            &client,
            count,
            dim,
            arg(&pictures),
            arg(&grid_of_colours),
            arg(&rarity),
            pixels,
            equalization,
        );
        let (count, dim) = grid_of(views * chunks as usize, 1, CUBE);
        chunk_totals::launch(&client, count, dim, arg(&rarity), arg(&totals), pixels, chunks);
        let (count, dim) = grid_of(views * pixels as usize, 1, CUBE);
        shares_of_all::launch(
            &client,
            count,
            dim,
            arg(&rarity),
            arg(&totals),
            arg(&weights),
            pixels,
            chunks,
        );
        Some(weights)
    }

    fn sums(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        weights: Option<FloatTensor<Self>>,
        side: usize,
    ) -> FloatTensor<Self> {
        let [pictures, filters, phases] = [averaged(pictures, side), filters, phases].map(into_contiguous);
        let weighted = weights.is_some();
        // Without weights nothing of the buffer is read.
        let weights = weights.map_or_else(|| phases.clone(), into_contiguous);
        let shape = pictures.shape();
        let (views, waves) = (shape[0], phases.shape()[0]);
        let pixels = shape[2] * shape[3];
        let chunks = pixels.div_ceil(CHUNK);
        let client = pictures.client.clone();
        let sums = empty_tensor(&pictures, Shape::new([views, chunks, waves]));
        let means = empty_tensor(&pictures, Shape::new([views, waves]));
        let (count, dim) = grid_of(views * chunks * waves, 1, CUBE);
        chunk_sums::launch(
            &client,
            count,
            dim,
            pictures.into_buffer_arg(),
            filters.into_buffer_arg(),
            phases.into_buffer_arg(),
            weights.into_buffer_arg(),
            sums.clone().into_buffer_arg(),
            pixels as u32,
            chunks as u32,
            weighted,
        );
        let (count, dim) = grid_of(views * waves, 1, CUBE);
        let scale = if weighted { 1.0 } else { 1.0 / pixels as f32 };
        let (sums, out) = (sums.into_buffer_arg(), means.clone().into_buffer_arg());
        mean_of_chunks::launch(&client, count, dim, sums, out, waves as u32, chunks as u32, scale);
        means
    }

    fn sums_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        weights: Option<FloatTensor<Self>>,
        gradient: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let all = pictures.clone();
        let tensors = [averaged(pictures, side), filters, phases, gradient];
        let [pictures, filters, phases, gradient] = tensors.map(into_contiguous);
        let weighted = weights.is_some();
        let weights = weights.map_or_else(|| phases.clone(), into_contiguous);
        let shape = pictures.shape();
        let pixels = shape[2] * shape[3];
        let client = pictures.client.clone();
        let out = empty_tensor(&pictures, shape.clone());
        let (count, dim) = grid_of(shape[0] * pixels, 1, CUBE);
        to_pixels::launch(
            &client,
            count,
            dim,
            pictures.into_buffer_arg(),
            filters.into_buffer_arg(),
            phases.into_buffer_arg(),
            weights.into_buffer_arg(),
            gradient.into_buffer_arg(),
            out.clone().into_buffer_arg(),
            pixels as u32,
            1.0 / pixels as f32,
            weighted,
        );
        match side {
            1 => out,
            n => Self::avg_pool2d_backward(all, out, [n; 2], [n; 2], [0; 2], true, false),
        }
    }
}

/// Means of squares of pictures.
fn averaged(pictures: CubeTensor, side: usize) -> CubeTensor {
    match side {
        1 => pictures,
        n => Cube::avg_pool2d(pictures, [n; 2], [n; 2], [0; 2], true, false),
    }
}
