//! Multi-head scaled dot-product attention (Vaswani et al. 2017) of tokens to each other: a cube a token and head.
//!
//! Queries, keys and values lie side by side, `[batch][tokens][3][heads][dim]`, as one linear map makes them. The backward pass
//! computes the weights anew instead of keeping them. Every sum has a fixed order.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use crate::launch::empty_tensor;

/// Units of a cube.
const UNITS: usize = 64;
/// Most tokens whose weights fit a cube's memory, and most numbers of a head.
const MOST: usize = 1024;

/// How tokens attend to each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attention {
    pub heads: usize,
    /// Whether a token attends to itself and those before it only.
    pub causal: bool,
}

/// Sizes that kernels are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Sizes {
    tokens: usize,
    heads: usize,
    dim: usize,
    causal: bool,
}

/// Whether so many tokens and numbers of a head are few enough.
pub(super) fn fits(tokens: usize, dim: usize) -> bool {
    tokens <= MOST && dim <= MOST
}

/// Leaves in `weights` what of each token's value the query of a cube's token takes, before division by their sum, which is
/// returned. `query` holds the query, times one over the root of its length.
#[cube]
fn weigh(
    qkv: &[f32],
    query: &mut Shared<[f32]>,
    weights: &mut Shared<[f32]>,
    first: usize,
    #[comptime] sizes: Sizes,
) -> f32 {
    let unit = UNIT_POS as usize;
    let own = CUBE_POS_X as usize;
    let token = comptime!(3 * sizes.heads * sizes.dim);
    let scale = comptime!(1.0 / (sizes.dim as f32).sqrt());
    let mut k = unit;
    while k < comptime!(sizes.dim) {
        query[k] = scale * qkv[first + own * token + k];
        k += UNITS;
    }
    sync_cube();
    let mut other = unit;
    while other < comptime!(sizes.tokens) {
        let key = first + other * token + comptime!(sizes.heads * sizes.dim);
        let mut score = 0.0f32;
        for k in 0..comptime!(sizes.dim) {
            score += query[k] * qkv[key + k];
        }
        if comptime!(sizes.causal) && other > own {
            score = -1e9f32;
        }
        weights[other] = score;
        other += UNITS;
    }
    sync_cube();
    let mut largest = weights[0];
    for other in 1..comptime!(sizes.tokens) {
        largest = max(largest, weights[other]);
    }
    sync_cube();
    let mut other = unit;
    while other < comptime!(sizes.tokens) {
        weights[other] = f32::exp(weights[other] - largest);
        other += UNITS;
    }
    sync_cube();
    let mut sum = 0.0f32;
    for other in 0..comptime!(sizes.tokens) {
        sum += weights[other];
    }
    sum
}

/// The first number of a cube's batch and head.
#[cube]
fn first_of_head(#[comptime] sizes: Sizes) -> usize {
    CUBE_POS_Z as usize * comptime!(sizes.tokens * 3 * sizes.heads * sizes.dim)
        + CUBE_POS_Y as usize * comptime!(sizes.dim)
}

/// What each token takes of all values: `out` is `[batch][tokens][heads][dim]`.
#[cube(launch)]
fn attend(qkv: &[f32], out: &mut [f32], #[comptime] sizes: Sizes) {
    let mut query = Shared::<[f32]>::new_slice(comptime!(sizes.dim));
    let mut weights = Shared::<[f32]>::new_slice(comptime!(sizes.tokens));
    let first = first_of_head(sizes);
    let sum = weigh(qkv, &mut query, &mut weights, first, sizes);
    let width = comptime!(sizes.heads * sizes.dim);
    let at = (CUBE_POS_Z as usize * comptime!(sizes.tokens) + CUBE_POS_X as usize) * width
        + CUBE_POS_Y as usize * comptime!(sizes.dim);
    let mut k = UNIT_POS as usize;
    while k < comptime!(sizes.dim) {
        let mut taken = 0.0f32;
        for other in 0..comptime!(sizes.tokens) {
            taken += weights[other] * qkv[first + other * 3 * width + 2 * width + k];
        }
        out[at + k] = taken / sum;
        k += UNITS;
    }
}

/// The gradient to queries; and of each token and head the weights of all tokens, and the gradient to the scores that they come
/// from: `[batch][heads][tokens][tokens]`.
#[cube(launch)]
fn to_queries(
    qkv: &[f32],
    gradient: &[f32],
    to_qkv: &mut [f32],
    shares: &mut [f32],
    slopes: &mut [f32],
    #[comptime] sizes: Sizes,
) {
    let mut query = Shared::<[f32]>::new_slice(comptime!(sizes.dim));
    let mut weights = Shared::<[f32]>::new_slice(comptime!(sizes.tokens));
    let mut slope = Shared::<[f32]>::new_slice(comptime!(sizes.tokens));
    let first = first_of_head(sizes);
    let sum = weigh(qkv, &mut query, &mut weights, first, sizes);
    let unit = UNIT_POS as usize;
    let own = CUBE_POS_X as usize;
    let width = comptime!(sizes.heads * sizes.dim);
    let of_out =
        (CUBE_POS_Z as usize * comptime!(sizes.tokens) + own) * width + CUBE_POS_Y as usize * comptime!(sizes.dim);
    let mut other = unit;
    while other < comptime!(sizes.tokens) {
        let value = first + other * 3 * width + 2 * width;
        let mut along = 0.0f32;
        for k in 0..comptime!(sizes.dim) {
            along += gradient[of_out + k] * qkv[value + k];
        }
        slope[other] = along;
        other += UNITS;
    }
    sync_cube();
    let mut mean = 0.0f32;
    for other in 0..comptime!(sizes.tokens) {
        mean += weights[other] * slope[other];
    }
    mean /= sum;
    sync_cube();
    let row = ((CUBE_POS_Z as usize * comptime!(sizes.heads) + CUBE_POS_Y as usize) * comptime!(sizes.tokens) + own)
        * comptime!(sizes.tokens);
    let mut other = unit;
    while other < comptime!(sizes.tokens) {
        let share = weights[other] / sum;
        let to_score = share * (slope[other] - mean);
        shares[row + other] = share;
        slopes[row + other] = to_score;
        slope[other] = to_score;
        other += UNITS;
    }
    sync_cube();
    let scale = comptime!(1.0 / (sizes.dim as f32).sqrt());
    let mut k = unit;
    while k < comptime!(sizes.dim) {
        let mut to_query = 0.0f32;
        for other in 0..comptime!(sizes.tokens) {
            to_query += slope[other] * qkv[first + other * 3 * width + width + k];
        }
        to_qkv[first + own * 3 * width + k] = scale * to_query;
        k += UNITS;
    }
}

/// The gradient to keys and values of a cube's token.
#[cube(launch)]
fn to_keys_and_values(
    qkv: &[f32],
    gradient: &[f32],
    shares: &[f32],
    slopes: &[f32],
    to_qkv: &mut [f32],
    #[comptime] sizes: Sizes,
) {
    let first = first_of_head(sizes);
    let own = CUBE_POS_X as usize;
    let width = comptime!(sizes.heads * sizes.dim);
    let head =
        (CUBE_POS_Z as usize * comptime!(sizes.heads) + CUBE_POS_Y as usize) * comptime!(sizes.tokens * sizes.tokens);
    let of_out = CUBE_POS_Z as usize * comptime!(sizes.tokens) * width + CUBE_POS_Y as usize * comptime!(sizes.dim);
    let scale = comptime!(1.0 / (sizes.dim as f32).sqrt());
    let mut k = UNIT_POS as usize;
    while k < comptime!(sizes.dim) {
        let mut to_key = 0.0f32;
        let mut to_value = 0.0f32;
        for other in 0..comptime!(sizes.tokens) {
            let at = head + other * comptime!(sizes.tokens) + own;
            to_key += slopes[at] * qkv[first + other * 3 * width + k];
            to_value += shares[at] * gradient[of_out + other * width + k];
        }
        let to = first + own * 3 * width + k;
        to_qkv[to + width] = scale * to_key;
        to_qkv[to + 2 * width] = to_value;
        k += UNITS;
    }
}

impl Attention {
    /// Of tokens `[b, n, 3 w]`.
    fn sizes(self, qkv: &CubeTensor) -> (usize, Sizes) {
        let shape = qkv.shape();
        let sizes = Sizes {
            tokens: shape[1],
            heads: self.heads,
            dim: shape[2] / 3 / self.heads,
            causal: self.causal,
        };
        (shape[0], sizes)
    }

    /// `[b, n, w]` of tokens `[b, n, 3 w]`.
    pub fn forward(self, qkv: CubeTensor) -> CubeTensor {
        let qkv = into_contiguous(qkv);
        let (batch, sizes) = self.sizes(&qkv);
        let out = empty_tensor(&qkv, Shape::new([batch, sizes.tokens, sizes.heads * sizes.dim]));
        let client = qkv.client.clone();
        let out_of = out.clone().into_buffer_arg();
        attend::launch(
            &client,
            cubes(batch, sizes),
            units(),
            qkv.into_buffer_arg(),
            out_of,
            sizes,
        );
        out
    }

    /// The gradient to the tokens.
    pub fn backward(self, gradient: CubeTensor, qkv: CubeTensor) -> CubeTensor {
        let [gradient, qkv] = [gradient, qkv].map(into_contiguous);
        let (batch, sizes) = self.sizes(&qkv);
        let out = empty_tensor(&qkv, qkv.shape());
        let of_pairs = Shape::new([batch, sizes.heads, sizes.tokens, sizes.tokens]);
        let [shares, slopes] = [0; 2].map(|_| empty_tensor(&qkv, of_pairs.clone()));
        let client = qkv.client.clone();
        let argument = |tensor: &CubeTensor| tensor.clone().into_buffer_arg();
        to_queries::launch(
            &client,
            cubes(batch, sizes),
            units(),
            argument(&qkv),
            argument(&gradient),
            argument(&out),
            argument(&shares),
            argument(&slopes),
            sizes,
        );
        to_keys_and_values::launch(
            &client,
            cubes(batch, sizes),
            units(),
            argument(&qkv),
            argument(&gradient),
            argument(&shares),
            argument(&slopes),
            argument(&out),
            sizes,
        );
        out
    }
}

/// A cube for each token, head and sequence.
fn cubes(batch: usize, sizes: Sizes) -> CubeCount {
    CubeCount::Static(sizes.tokens as u32, sizes.heads as u32, batch as u32)
}

fn units() -> CubeDim {
    CubeDim::new_1d(UNITS as u32)
}
