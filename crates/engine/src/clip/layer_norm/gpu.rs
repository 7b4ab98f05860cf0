//! Layer normalisation on the GPU: a cube a row. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use cubecl::prelude::*;

use super::{FloatTensor, LayerNormalized, Normalization};
use crate::launch::{CUBE, a_cube_each, cube_of_layer, empty_tensor, sum_of_cube};

const UNITS: usize = CUBE as usize;

/// Rows of `x` (`[rows][width]`) normalised to `out`; their means and one over their deviations to `moments` (`[rows][2]`).
#[cube(launch)]
fn normalize_rows(x: &[f32], gamma: &[f32], beta: &[f32], out: &mut [f32], moments: &mut [f32], epsilon: f32) {
    let width = gamma.len();
    let row = cube_of_layer();
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let first = row * width;
    let inside = 2 * row < moments.len();
    let mut sum = 0.0f32;
    if inside {
        let mut k = UNIT_POS as usize;
        while k < width {
            sum += x[first + k];
            k += UNITS;
        }
    }
    let mean = sum_of_cube(sum, &mut shared) / width as f32;
    let mut squares = 0.0f32;
    if inside {
        let mut k = UNIT_POS as usize;
        while k < width {
            let off = x[first + k] - mean;
            squares += off * off;
            k += UNITS;
        }
    }
    let variance = sum_of_cube(squares, &mut shared) / width as f32;
    let scale = 1.0f32 / f32::sqrt(variance + epsilon);
    if inside {
        let mut k = UNIT_POS as usize;
        while k < width {
            out[first + k] = (x[first + k] - mean) * scale * gamma[k] + beta[k];
            k += UNITS;
        }
        if UNIT_POS == 0 {
            moments[2 * row] = mean;
            moments[2 * row + 1] = scale;
        }
    }
}

/// The gradient to `x` from that to normalised rows.
#[cube(launch)]
fn rows_backward(x: &[f32], gamma: &[f32], moments: &[f32], gradient: &[f32], out: &mut [f32]) {
    let width = gamma.len();
    let row = cube_of_layer();
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let first = row * width;
    let inside = 2 * row < moments.len();
    let mut level = 0.0f32;
    let mut along = 0.0f32;
    let mut mean = 0.0f32;
    let mut scale = 0.0f32;
    if inside {
        mean = moments[2 * row];
        scale = moments[2 * row + 1];
        let mut k = UNIT_POS as usize;
        while k < width {
            let weighed = gradient[first + k] * gamma[k];
            level += weighed;
            along += weighed * (x[first + k] - mean) * scale;
            k += UNITS;
        }
    }
    let level = sum_of_cube(level, &mut shared) / width as f32;
    let along = sum_of_cube(along, &mut shared) / width as f32;
    if inside {
        let mut k = UNIT_POS as usize;
        while k < width {
            let normal = (x[first + k] - mean) * scale;
            out[first + k] = scale * (gradient[first + k] * gamma[k] - level - normal * along);
            k += UNITS;
        }
    }
}

impl LayerNormalized for Cube {
    fn layer_normalized(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let [out, _] = Self::normalize(x, gamma, beta, epsilon);
        out
    }
}

impl Normalization for Cube {
    fn normalize(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> [FloatTensor<Self>; 2] {
        let [x, gamma, beta] = [x, gamma, beta].map(into_contiguous);
        let rows = x.shape().num_elements() / gamma.shape()[0];
        let client = x.client.clone();
        let out = empty_tensor(&x, x.shape());
        let moments = empty_tensor(&x, Shape::new([rows, 2]));
        let (count, dim) = a_cube_each(rows);
        normalize_rows::launch(
            &client,
            count,
            dim,
            x.into_buffer_arg(),
            gamma.into_buffer_arg(),
            beta.into_buffer_arg(),
            out.clone().into_buffer_arg(),
            moments.clone().into_buffer_arg(),
            epsilon,
        );
        [out, moments]
    }

    fn normalize_backward(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        moments: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [x, gamma, gradient] = [x, gamma, gradient].map(into_contiguous);
        let client = x.client.clone();
        let out = empty_tensor(&x, x.shape());
        let (count, dim) = a_cube_each(moments.shape()[0]);
        rows_backward::launch(
            &client,
            count,
            dim,
            x.into_buffer_arg(),
            gamma.into_buffer_arg(),
            moments.into_buffer_arg(),
            gradient.into_buffer_arg(),
            out.clone().into_buffer_arg(),
        );
        out
    }
}
