//! Gaussian error linear units (Hendrycks and Gimpel 2016), exact and as CLIP's published models approximate them.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
// `erf` is CubeCL's.
#![allow(unstable_name_collisions)]
use burn::backend::TensorMetadata;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;
use std::f32::consts::FRAC_1_SQRT_2;

use crate::launch::{empty_tensor, grid};

/// The factor of the approximation.
const QUICK: f32 = 1.702;
/// One over the root of two pi.
const DENSITY: f32 = 0.398_942_3;

/// Share of a value that is let through: the normal distribution's, or if `quick` a logistic one.
#[cube]
fn share(x: f32, #[comptime] quick: bool) -> f32 {
    if comptime!(quick) {
        // Devices need not have infinity.
        1.0f32 / (1.0f32 + f32::exp(min(-QUICK * x, 80.0f32)))
    } else {
        0.5f32 * (1.0f32 + f32::erf(x * FRAC_1_SQRT_2))
    }
}

#[cube(launch)]
fn units_of(x: &[f32], out: &mut [f32], #[comptime] quick: bool) {
    let unit = ABSOLUTE_POS;
    if unit < x.len() {
        out[unit] = x[unit] * share(x[unit], quick);
    }
}

#[cube(launch)]
fn units_backward(x: &[f32], gradient: &[f32], out: &mut [f32], #[comptime] quick: bool) {
    let unit = ABSOLUTE_POS;
    if unit < x.len() {
        let value = x[unit];
        let through = share(value, quick);
        let density = if comptime!(quick) {
            QUICK * through * (1.0f32 - through)
        } else {
            DENSITY * f32::exp(-0.5f32 * value * value)
        };
        out[unit] = gradient[unit] * (through + value * density);
    }
}

/// Of every value.
pub(super) fn forward(x: CubeTensor, quick: bool) -> CubeTensor {
    let x = into_contiguous(x);
    let out = empty_tensor(&x, x.shape());
    let (count, dim) = grid(x.shape().num_elements(), 1);
    let (client, result) = (x.client.clone(), out.clone().into_buffer_arg());
    units_of::launch(&client, count, dim, x.into_buffer_arg(), result, quick);
    out
}

/// The gradient to x.
pub(super) fn backward(gradient: CubeTensor, x: CubeTensor, quick: bool) -> CubeTensor {
    let [gradient, x] = [gradient, x].map(into_contiguous);
    let out = empty_tensor(&x, x.shape());
    let (count, dim) = grid(x.shape().num_elements(), 1);
    let (client, result) = (x.client.clone(), out.clone().into_buffer_arg());
    let gradient = gradient.into_buffer_arg();
    units_backward::launch(&client, count, dim, x.into_buffer_arg(), gradient, result, quick);
    out
}
