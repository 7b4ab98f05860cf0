//! Pictures less a mean and over a deviation, by channel.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::TensorMetadata;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use crate::launch::{empty_tensor, grid};

/// A unit a number of `x` (`[views][3][area]`).
#[cube(launch)]
fn by_channel(
    x: &[f32],
    out: &mut [f32],
    area: u32,
    red: f32,
    green: f32,
    blue: f32,
    of_red: f32,
    of_green: f32,
    of_blue: f32,
) {
    let unit = ABSOLUTE_POS;
    if unit < x.len() {
        let channel = unit / area as usize % 3;
        let mut mean = red;
        let mut deviation = of_red;
        if channel == 1 {
            mean = green;
            deviation = of_green;
        }
        if channel == 2 {
            mean = blue;
            deviation = of_blue;
        }
        out[unit] = (x[unit] - mean) / deviation;
    }
}

/// `(x - mean) / deviation`; its gradient is the same with a mean of 0.
pub(super) fn scaled(x: CubeTensor, mean: [f32; 3], deviation: [f32; 3]) -> CubeTensor {
    let x = into_contiguous(x);
    let shape = x.shape();
    let out = empty_tensor(&x, shape.clone());
    let (count, dim) = grid(shape.num_elements(), 1);
    let ([red, green, blue], [of_red, of_green, of_blue]) = (mean, deviation);
    by_channel::launch(
        &x.client.clone(),
        count,
        dim,
        x.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        (shape[2] * shape[3]) as u32,
        red,
        green,
        blue,
        of_red,
        of_green,
        of_blue,
    );
    out
}
