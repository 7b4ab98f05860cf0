//! The operations as burn's devices have them; on a card alone.
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Cube, backend_extension};

use super::attention::Attention;
use super::product::Addends;
use super::{affine, cross_entropy, gelu, product, standardize, unit_rows};

/// What [`super`] says of each.
#[backend_extension(Autodiff, Cube)]
pub(super) trait CardOperations: Backend {
    fn affine_rows(
        x: FloatTensor<Self>,
        mean: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        centred: bool,
        biased: bool,
    ) -> FloatTensor<Self>;

    fn many_rows(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        onto: FloatTensor<Self>,
        biased: bool,
        adding: bool,
    ) -> FloatTensor<Self>;

    fn rows_of_unit_length(x: FloatTensor<Self>, tiny: f32) -> FloatTensor<Self>;

    fn standardized(pictures: FloatTensor<Self>, mean: [f32; 3], deviation: [f32; 3]) -> FloatTensor<Self>;

    fn mean_cross_entropy(logits: FloatTensor<Self>, targets: FloatTensor<Self>, temperature: f32)
    -> FloatTensor<Self>;

    fn attended(qkv: FloatTensor<Self>, heads: usize, causal: bool) -> FloatTensor<Self>;

    fn gaussian_units(x: FloatTensor<Self>, quick: bool) -> FloatTensor<Self>;
}

impl CardOperations for Cube {
    fn affine_rows(
        x: FloatTensor<Self>,
        mean: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        centred: bool,
        biased: bool,
    ) -> FloatTensor<Self> {
        affine::forward(x, centred.then_some(mean), weight, biased.then_some(bias))
    }

    fn many_rows(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        onto: FloatTensor<Self>,
        biased: bool,
        adding: bool,
    ) -> FloatTensor<Self> {
        let (bias, onto) = (biased.then_some(bias), adding.then_some(onto));
        product::forward(x, weight, Addends { bias, onto })
    }

    fn rows_of_unit_length(x: FloatTensor<Self>, tiny: f32) -> FloatTensor<Self> {
        unit_rows::forward(x, tiny).0
    }

    fn standardized(pictures: FloatTensor<Self>, mean: [f32; 3], deviation: [f32; 3]) -> FloatTensor<Self> {
        standardize::scaled(pictures, mean, deviation)
    }

    fn mean_cross_entropy(
        logits: FloatTensor<Self>,
        targets: FloatTensor<Self>,
        temperature: f32,
    ) -> FloatTensor<Self> {
        cross_entropy::forward(logits, targets, temperature).0
    }

    fn attended(qkv: FloatTensor<Self>, heads: usize, causal: bool) -> FloatTensor<Self> {
        Attention { heads, causal }.forward(qkv)
    }

    fn gaussian_units(x: FloatTensor<Self>, quick: bool) -> FloatTensor<Self> {
        gelu::forward(x, quick)
    }
}
