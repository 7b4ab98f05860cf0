//! Layer normalisation on the GPU: a cube a row. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::{FloatTensor, LayerNormalized, Normalization};

/// Units of a cube.
const CUBE: u32 = 128;
const UNITS: usize = CUBE as usize;
/// Cubes a dimension that every device allows.
const MAX_CUBES: u32 = 65_535;

/// The sum of `value` over the units of a cube, which all get.
#[cube]
fn sum_of_cube(value: f32, shared: &mut Shared<[f32]>) -> f32 {
    let unit = UNIT_POS as usize;
    shared[unit] = value;
    #[unroll]
    for level in 0..comptime!(UNITS.ilog2() as usize) {
        sync_cube();
        let half = comptime!(UNITS >> (level + 1));
        if unit < half {
            let other = shared[unit + half];
            shared[unit] += other;
        }
    }
    sync_cube();
    let sum = shared[0];
    sync_cube();
    sum
}

/// Rows of `x` (`[rows][width]`) normalised to `out`; their means and one over their deviations to `moments` (`[rows][2]`).
#[cube(launch)]
fn normalize_rows(x: &[f32], gamma: &[f32], beta: &[f32], out: &mut [f32], moments: &mut [f32], epsilon: f32) {
    let width = gamma.len();
    let row = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize;
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
    let row = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize;
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
        let out = empty(&x, x.shape());
        let moments = empty(&x, Shape::new([rows, 2]));
        let (count, dim) = grid(rows);
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
        let out = empty(&x, x.shape());
        let (count, dim) = grid(moments.shape()[0]);
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

/// A new tensor on the device of `like`.
fn empty(like: &CubeTensor, shape: Shape) -> CubeTensor {
    let handle = like.client.empty(shape.num_elements() * 4);
    CubeTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, like.dtype)
}

/// One cube for each of `rows`.
fn grid(rows: usize) -> (CubeCount, CubeDim) {
    let columns = (rows as u32).clamp(1, MAX_CUBES);
    (
        CubeCount::Static(columns, (rows as u32).div_ceil(columns).max(1), 1),
        CubeDim::new_1d(CUBE),
    )
}
