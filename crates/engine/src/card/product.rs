//! Products of many rows with constant weights: a cube computes a square of the output from squares in shared memory. Every sum
//! has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use crate::launch::empty_tensor;

/// Rows and columns of the output that a cube computes.
const SQUARE: usize = 64;
/// Terms of the sums that are in shared memory at a time.
const DEPTH: usize = 16;
/// Rows and columns of the output that a unit computes.
const OWN: usize = 4;
/// Units along a side of the square.
const SIDE: usize = SQUARE / OWN;
const UNITS: usize = SIDE * SIDE;

/// `out` (`[rows][columns]`) is `x weight + bias + onto`, of `x` (`[rows][depth]`) and a weight `[depth][columns]`, or of one
/// `[columns][depth]` if `transposed`.
#[cube(launch)]
fn product(
    x: &[f32],
    weight: &[f32],
    bias: &[f32],
    onto: &[f32],
    out: &mut [f32],
    rows: u32,
    depth: u32,
    columns: u32,
    #[comptime] transposed: bool,
    #[comptime] biased: bool,
    #[comptime] adding: bool,
) {
    let (rows, depth, columns) = (rows as usize, depth as usize, columns as usize);
    let unit = UNIT_POS as usize;
    let first_row = CUBE_POS_Y as usize * SQUARE;
    let first_column = CUBE_POS_X as usize * SQUARE;
    let own_row = unit / SIDE * OWN;
    let own_column = unit % SIDE * OWN;
    // By terms, so that a unit reads what lies side by side.
    let mut left = Shared::<[f32]>::new_slice(DEPTH * SQUARE);
    let mut right = Shared::<[f32]>::new_slice(DEPTH * SQUARE);
    let mut sums = Array::<f32>::new(OWN * OWN);
    #[unroll]
    for at in 0..OWN * OWN {
        sums[at] = 0.0f32;
    }
    let mut first = 0usize;
    while first < depth {
        #[unroll]
        for part in 0..comptime!(DEPTH * SQUARE / UNITS) {
            let place = unit + comptime!(part * UNITS);
            // Neighbouring units read neighbouring numbers of a row.
            let term = place % DEPTH;
            let row = place / DEPTH;
            let mut value = 0.0f32;
            if first_row + row < rows && first + term < depth {
                value = x[(first_row + row) * depth + first + term];
            }
            left[term * SQUARE + row] = value;
            let mut of_weight = 0.0f32;
            if comptime!(transposed) {
                if first_column + row < columns && first + term < depth {
                    of_weight = weight[(first_column + row) * depth + first + term];
                }
                right[term * SQUARE + row] = of_weight;
            } else {
                let column = place % SQUARE;
                let term = place / SQUARE;
                if first_column + column < columns && first + term < depth {
                    of_weight = weight[(first + term) * columns + first_column + column];
                }
                right[term * SQUARE + column] = of_weight;
            }
        }
        sync_cube();
        #[unroll]
        for term in 0..DEPTH {
            let mut of_rows = Array::<f32>::new(OWN);
            let mut of_columns = Array::<f32>::new(OWN);
            #[unroll]
            for k in 0..OWN {
                of_rows[k] = left[term * SQUARE + own_row + k];
                of_columns[k] = right[term * SQUARE + own_column + k];
            }
            #[unroll]
            for i in 0..OWN {
                #[unroll]
                for j in 0..OWN {
                    sums[i * OWN + j] += of_rows[i] * of_columns[j];
                }
            }
        }
        sync_cube();
        first += DEPTH;
    }
    #[unroll]
    for i in 0..OWN {
        #[unroll]
        for j in 0..OWN {
            let row = first_row + own_row + i;
            let column = first_column + own_column + j;
            if row < rows && column < columns {
                let mut sum = sums[i * OWN + j];
                if comptime!(biased) {
                    sum += bias[column];
                }
                if comptime!(adding) {
                    sum += onto[row * columns + column];
                }
                out[row * columns + column] = sum;
            }
        }
    }
}

/// What a product is added to: `[columns]`, and `[rows, columns]`.
#[derive(Default)]
pub(super) struct Addends {
    pub bias: Option<CubeTensor>,
    pub onto: Option<CubeTensor>,
}

fn launched(x: CubeTensor, weight: CubeTensor, addends: Addends, transposed: bool) -> CubeTensor {
    let (biased, adding) = (addends.bias.is_some(), addends.onto.is_some());
    let (shape, sizes) = (x.shape(), weight.shape());
    let [x, weight] = [x, weight].map(into_contiguous);
    // What is not there is not read.
    let [bias, onto] = [addends.bias, addends.onto].map(|part| part.map_or_else(|| weight.clone(), into_contiguous));
    let (depth, columns) = match transposed {
        true => (sizes[1], sizes[0]),
        false => (sizes[0], sizes[1]),
    };
    let rows = shape.num_elements() / depth;
    let mut of_out: Vec<usize> = (0..shape.num_dims()).map(|dim| shape[dim]).collect();
    if let Some(last) = of_out.last_mut() {
        *last = columns;
    }
    let out = empty_tensor(&x, Shape::from(of_out));
    product::launch(
        &x.client.clone(),
        CubeCount::Static(columns.div_ceil(SQUARE) as u32, rows.div_ceil(SQUARE) as u32, 1),
        CubeDim::new_1d(UNITS as u32),
        x.into_buffer_arg(),
        weight.into_buffer_arg(),
        bias.into_buffer_arg(),
        onto.into_buffer_arg(),
        out.clone().into_buffer_arg(),
        rows as u32,
        depth as u32,
        columns as u32,
        transposed,
        biased,
        adding,
    );
    out
}

/// `x weight` of the last dimension of x, and what it is added to.
pub(super) fn forward(x: CubeTensor, weight: CubeTensor, addends: Addends) -> CubeTensor {
    launched(x, weight, addends, false)
}

/// The gradient to x.
pub(super) fn backward(gradient: CubeTensor, weight: CubeTensor) -> CubeTensor {
    launched(gradient, weight, Addends::default(), true)
}
