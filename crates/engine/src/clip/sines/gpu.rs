//! Mean sines on the GPU: CubeCL kernels on burn's buffers. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::ops::ModuleOps;
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::{FloatTensor, MeanSines, MeanSinesBackward, TURN};

/// Units of a cube.
const CUBE: u32 = 64;
/// Cubes a dimension that every device allows.
const MAX_CUBES: u32 = 65_535;
/// Pixels that one unit adds up.
const CHUNK: usize = 256;

/// `angle` less whole turns.
#[cube]
fn reduce(angle: f32) -> f32 {
    let turns = f32::round(angle * 0.159_154_94f32);
    angle - turns * TURN[0] - turns * TURN[1]
}

/// A unit for each picture, chunk of pixels and wave: `sums` is `[views][chunks][waves]`.
#[cube(launch)]
fn chunk_sums(pictures: &[f32], filters: &[f32], phases: &[f32], sums: &mut [f32], pixels: u32, chunks: u32) {
    let unit = ABSOLUTE_POS;
    if unit < sums.len() {
        let waves = phases.len();
        let wave = unit % waves;
        let chunk = unit / waves % chunks as usize;
        let picture = unit / waves / chunks as usize * 3 * pixels as usize;
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
            sum += f32::sin(reduce(angle));
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
    gradient: &[f32],
    out: &mut [f32],
    pixels: u32,
    scale: f32,
) {
    let unit = ABSOLUTE_POS;
    if 3 * unit < out.len() {
        let waves = phases.len();
        let view = unit / pixels as usize;
        let at = view * 3 * pixels as usize + unit % pixels as usize;
        let r = pictures[at];
        let g = pictures[at + pixels as usize];
        let b = pictures[at + 2 * pixels as usize];
        let mut to_r = 0.0f32;
        let mut to_g = 0.0f32;
        let mut to_b = 0.0f32;
        for wave in 0..waves {
            let red = filters[3 * wave];
            let green = filters[3 * wave + 1];
            let blue = filters[3 * wave + 2];
            let angle = red * r + green * g + blue * b + phases[wave];
            let slope = f32::cos(reduce(angle)) * gradient[view * waves + wave] * scale;
            to_r += red * slope;
            to_g += green * slope;
            to_b += blue * slope;
        }
        out[at] = to_r;
        out[at + pixels as usize] = to_g;
        out[at + 2 * pixels as usize] = to_b;
    }
}

impl MeanSines for Cube {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let [pictures, filters, phases] = [averaged(pictures, side), filters, phases].map(into_contiguous);
        let shape = pictures.shape();
        let (views, waves) = (shape[0], phases.shape()[0]);
        let pixels = shape[2] * shape[3];
        let chunks = pixels.div_ceil(CHUNK);
        let client = pictures.client.clone();
        let sums = empty(&pictures, Shape::new([views, chunks, waves]));
        let means = empty(&pictures, Shape::new([views, waves]));
        let (count, dim) = grid(views * chunks * waves);
        chunk_sums::launch(
            &client,
            count,
            dim,
            pictures.into_buffer_arg(),
            filters.into_buffer_arg(),
            phases.into_buffer_arg(),
            sums.clone().into_buffer_arg(),
            pixels as u32,
            chunks as u32,
        );
        let (count, dim) = grid(views * waves);
        let scale = 1.0 / pixels as f32;
        let (sums, out) = (sums.into_buffer_arg(), means.clone().into_buffer_arg());
        mean_of_chunks::launch(&client, count, dim, sums, out, waves as u32, chunks as u32, scale);
        means
    }
}

impl MeanSinesBackward for Cube {
    fn mean_sines_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let all = pictures.clone();
        let tensors = [averaged(pictures, side), filters, phases, gradient];
        let [pictures, filters, phases, gradient] = tensors.map(into_contiguous);
        let shape = pictures.shape();
        let pixels = shape[2] * shape[3];
        let client = pictures.client.clone();
        let out = empty(&pictures, shape.clone());
        let (count, dim) = grid(shape[0] * pixels);
        to_pixels::launch(
            &client,
            count,
            dim,
            pictures.into_buffer_arg(),
            filters.into_buffer_arg(),
            phases.into_buffer_arg(),
            gradient.into_buffer_arg(),
            out.clone().into_buffer_arg(),
            pixels as u32,
            1.0 / pixels as f32,
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

/// A new tensor on the device of `like`.
fn empty(like: &CubeTensor, shape: Shape) -> CubeTensor {
    let handle = like.client.empty(shape.num_elements() * 4);
    CubeTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, like.dtype)
}

/// One unit for each of `units`.
fn grid(units: usize) -> (CubeCount, CubeDim) {
    let cubes = (units as u32).div_ceil(CUBE);
    let columns = cubes.clamp(1, MAX_CUBES);
    (
        CubeCount::Static(columns, cubes.div_ceil(columns).max(1), 1),
        CubeDim::new_1d(CUBE),
    )
}
