//! Linear maps of a few rows with constant weights. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use crate::launch::{CUBE, empty_tensor};

const UNITS: usize = CUBE as usize;
/// Columns of the output that a cube computes, and parts that it cuts each sum into.
const COLUMNS: usize = 32;
const PARTS: usize = UNITS / COLUMNS;

/// A cube for each row and [`COLUMNS`] columns: `out` (`[rows][n]`) is `(x - mean) weight + bias`.
#[cube(launch)]
fn rows_times_weight(
    x: &[f32],
    mean: &[f32],
    weight: &[f32],
    bias: &[f32],
    out: &mut [f32],
    width: u32,
    columns: u32,
    #[comptime] centred: bool,
    #[comptime] biased: bool,
) {
    let unit = UNIT_POS as usize;
    let row = CUBE_POS_Y as usize;
    let lane = unit % COLUMNS;
    let part = unit / COLUMNS;
    let column = CUBE_POS_X as usize * COLUMNS + lane;
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut sum = 0.0f32;
    if column < columns as usize {
        let mut k = part;
        while k < width as usize {
            let mut value = x[row * width as usize + k];
            if centred {
                value -= mean[k];
            }
            sum += value * weight[k * columns as usize + column];
            k += PARTS;
        }
    }
    shared[unit] = sum;
    sync_cube();
    if part == 0 && column < columns as usize {
        let mut all = 0.0f32;
        #[unroll]
        for other in 0..PARTS {
            all += shared[other * COLUMNS + lane];
        }
        if biased {
            all += bias[column];
        }
        out[row * columns as usize + column] = all;
    }
}

/// A cube for each row and [`PARTS`] columns of the input: the gradient to it, `[rows][m]`, from that to the output.
#[cube(launch)]
fn rows_times_transposed(gradient: &[f32], weight: &[f32], out: &mut [f32], width: u32, columns: u32) {
    let unit = UNIT_POS as usize;
    let row = CUBE_POS_Y as usize;
    let lane = unit % COLUMNS;
    let place = unit / COLUMNS;
    let k = CUBE_POS_X as usize * PARTS + place;
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut sum = 0.0f32;
    if k < width as usize {
        // Neighbouring units read neighbouring weights.
        let mut column = lane;
        while column < columns as usize {
            sum += gradient[row * columns as usize + column] * weight[k * columns as usize + column];
            column += COLUMNS;
        }
    }
    shared[unit] = sum;
    sync_cube();
    if lane == 0 && k < width as usize {
        let mut all = 0.0f32;
        #[unroll]
        for other in 0..COLUMNS {
            all += shared[place * COLUMNS + other];
        }
        out[row * width as usize + k] = all;
    }
}

/// `(x - mean) weight + bias`.
pub(super) fn forward(
    x: CubeTensor,
    mean: Option<CubeTensor>,
    weight: CubeTensor,
    bias: Option<CubeTensor>,
) -> CubeTensor {
    let (centred, biased) = (mean.is_some(), bias.is_some());
    let [x, weight] = [x, weight].map(into_contiguous);
    let [mean, bias] = [mean, bias].map(|part| part.map_or_else(|| weight.clone(), into_contiguous));
    let (rows, [width, columns]) = (x.shape()[0], [weight.shape()[0], weight.shape()[1]]);
    let out = empty_tensor(&x, Shape::new([rows, columns]));
    rows_times_weight::launch(
        &x.client.clone(),
        CubeCount::Static(columns.div_ceil(COLUMNS) as u32, rows as u32, 1),
        CubeDim::new_1d(CUBE),
        x.into_buffer_arg(),
        mean.into_buffer_arg(),
        weight.into_buffer_arg(),
        bias.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        width as u32,
        columns as u32,
        centred,
        biased,
    );
    out
}

/// The gradient to x.
pub(super) fn backward(gradient: CubeTensor, weight: CubeTensor) -> CubeTensor {
    let [gradient, weight] = [gradient, weight].map(into_contiguous);
    let (rows, [width, columns]) = (gradient.shape()[0], [weight.shape()[0], weight.shape()[1]]);
    let out = empty_tensor(&gradient, Shape::new([rows, width]));
    rows_times_transposed::launch(
        &gradient.client.clone(),
        CubeCount::Static(width.div_ceil(PARTS) as u32, rows as u32, 1),
        CubeDim::new_1d(CUBE),
        gradient.into_buffer_arg(),
        weight.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        width as u32,
        columns as u32,
    );
    out
}
