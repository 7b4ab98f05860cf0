//! Rows made as long as 1: a cube a row.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use crate::launch::{CUBE, a_cube_each, cube_of_layer, empty_tensor, sum_of_cube};

const UNITS: usize = CUBE as usize;

/// `out` is `x scale` (`[rows][width]`) with `scale` one over the root of a row's sum of squares and `tiny`.
#[cube(launch)]
fn to_unit_rows(x: &[f32], out: &mut [f32], scales: &mut [f32], width: u32, tiny: f32) {
    let row = cube_of_layer();
    let first = row * width as usize;
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut sum = 0.0f32;
    if row < scales.len() {
        let mut k = UNIT_POS as usize;
        while k < width as usize {
            sum += x[first + k] * x[first + k];
            k += UNITS;
        }
    }
    let scale = 1.0f32 / f32::sqrt(sum_of_cube(sum, &mut shared) + tiny);
    if row < scales.len() {
        let mut k = UNIT_POS as usize;
        while k < width as usize {
            out[first + k] = x[first + k] * scale;
            k += UNITS;
        }
        if UNIT_POS == 0 {
            scales[row] = scale;
        }
    }
}

/// The gradient to `x`: what of it is across the row, times the scale.
#[cube(launch)]
fn across_rows(gradient: &[f32], rows: &[f32], scales: &[f32], out: &mut [f32], width: u32) {
    let row = cube_of_layer();
    let first = row * width as usize;
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut along = 0.0f32;
    if row < scales.len() {
        let mut k = UNIT_POS as usize;
        while k < width as usize {
            along += gradient[first + k] * rows[first + k];
            k += UNITS;
        }
    }
    let along = sum_of_cube(along, &mut shared);
    if row < scales.len() {
        let mut k = UNIT_POS as usize;
        while k < width as usize {
            out[first + k] = scales[row] * (gradient[first + k] - along * rows[first + k]);
            k += UNITS;
        }
    }
}

/// Rows of unit length, and one over what their lengths were.
pub(super) fn forward(x: CubeTensor, tiny: f32) -> (CubeTensor, CubeTensor) {
    let x = into_contiguous(x);
    let (rows, width) = (x.shape()[0], x.shape()[1]);
    let (out, scales) = (empty_tensor(&x, x.shape()), empty_tensor(&x, Shape::new([rows])));
    let (count, dim) = a_cube_each(rows);
    to_unit_rows::launch(
        &x.client.clone(),
        count,
        dim,
        x.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        scales.clone().into_buffer_arg(),
        width as u32,
        tiny,
    );
    (out, scales)
}

/// The gradient to the rows as they were.
pub(super) fn backward(gradient: CubeTensor, rows: CubeTensor, scales: CubeTensor) -> CubeTensor {
    let gradient = into_contiguous(gradient);
    let (count, width) = (rows.shape()[0], rows.shape()[1]);
    let out = empty_tensor(&rows, rows.shape());
    let (count, dim) = a_cube_each(count);
    across_rows::launch(
        &rows.client.clone(),
        count,
        dim,
        gradient.into_buffer_arg(),
        rows.into_buffer_arg(),
        scales.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        width as u32,
    );
    out
}
