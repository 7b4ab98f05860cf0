//! The mean binary cross-entropy of logits, with the gradient that it has: one cube.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use crate::launch::{CUBE, empty_tensor, grid, sum_of_cube};

const UNITS: usize = CUBE as usize;

/// For logits `[rows][bits]` and targets `[bits]`: `temperature` times the mean of `softplus(z)` to `out` (`[1]`), with `z`
/// the softened logit, its sign turned where the target is 1; its derivative by each logit to `slopes`.
#[cube(launch)]
fn mean_of_all(logits: &[f32], targets: &[f32], out: &mut [f32], slopes: &mut [f32], temperature: f32) {
    let count = logits.len();
    let share = 1.0f32 / f32::cast_from(count as u32);
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let mut sum = 0.0f32;
    let mut k = UNIT_POS as usize;
    while k < count {
        let sign = 1.0f32 - 2.0f32 * targets[k % targets.len()];
        let z = sign * logits[k] / temperature;
        // Neither overflows nor cancels.
        let small = f32::exp(-f32::abs(z));
        sum += max(z, 0.0f32) + f32::ln(1.0f32 + small);
        let mut slope = 1.0f32 / (1.0f32 + small);
        if z < 0.0f32 {
            slope = small / (1.0f32 + small);
        }
        slopes[k] = sign * slope * share;
        k += UNITS;
    }
    let sum = sum_of_cube(sum, &mut shared);
    if UNIT_POS == 0 {
        out[0] = temperature * sum * share;
    }
}

/// `slopes` times one number.
#[cube(launch)]
fn times(gradient: &[f32], slopes: &[f32], out: &mut [f32]) {
    let unit = ABSOLUTE_POS;
    if unit < slopes.len() {
        out[unit] = gradient[0] * slopes[unit];
    }
}

/// The mean, and its gradient to the logits.
pub(super) fn forward(logits: CubeTensor, targets: CubeTensor, temperature: f32) -> (CubeTensor, CubeTensor) {
    let [logits, targets] = [logits, targets].map(into_contiguous);
    let (out, slopes) = (
        empty_tensor(&logits, Shape::new([1])),
        empty_tensor(&logits, logits.shape()),
    );
    mean_of_all::launch(
        &logits.client.clone(),
        CubeCount::Static(1, 1, 1),
        CubeDim::new_1d(CUBE),
        logits.into_buffer_arg(),
        targets.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        slopes.clone().into_buffer_arg(),
        temperature,
    );
    (out, slopes)
}

/// The gradient to the logits for one to the mean.
pub(super) fn backward(gradient: CubeTensor, slopes: CubeTensor) -> CubeTensor {
    let gradient = into_contiguous(gradient);
    let out = empty_tensor(&slopes, slopes.shape());
    let (count, dim) = grid(slopes.shape().num_elements(), 1);
    times::launch(
        &slopes.client.clone(),
        count,
        dim,
        gradient.into_buffer_arg(),
        slopes.into_buffer_arg(),
        out.clone().into_buffer_arg(),
    );
    out
}
