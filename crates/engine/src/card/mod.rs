//! What a card does in one launch where a graph of tensors takes several: each launch costs the host 60 microseconds and
//! more (docs/performance.md), which is more than a card needs for most of them.
//!
//! The CPU device computes the same by burn's tensors; callers ask [`on_card`] which of both it is.
mod affine;
mod attention;
mod cross_entropy;
mod gelu;
mod graph;
mod operations;
mod product;
mod standardize;
mod unit_rows;

use burn::backend::{Dispatch, DispatchDevice};
use burn::nn::Linear;
use burn::tensor::Tensor;

use self::operations::CardOperations;

/// Whether a tensor is on a card.
pub(crate) fn on_card<const D: usize>(tensor: &Tensor<D>) -> bool {
    matches!(tensor.device().inner().as_dispatch(), DispatchDevice::Cube(_))
}

/// `(x - mean) weight + bias` of rows `[b, m]`, with `[m]`, `[m, n]` and `[n]` that are constants.
pub(crate) fn affine(x: Tensor<2>, mean: Option<Tensor<1>>, weight: Tensor<2>, bias: Option<Tensor<1>>) -> Tensor<2> {
    let (centred, biased) = (mean.is_some(), bias.is_some());
    let weight = weight.into_dispatch();
    // What is not there is not read.
    let [mean, bias] = [mean, bias].map(|part| part.map_or_else(|| weight.clone(), Tensor::into_dispatch));
    Tensor::from_dispatch(Dispatch::affine_rows(
        x.into_dispatch(),
        mean,
        weight,
        bias,
        centred,
        biased,
    ))
}

/// Rows from which on a product is computed by squares of the output; of fewer each row is one of a few.
const MANY: usize = 33;

/// A linear layer.
pub(crate) fn layer<const D: usize>(layer: &Linear, x: Tensor<D>) -> Tensor<D> {
    linear(x, layer.weight.val(), layer.bias.as_ref().map(|bias| bias.val()))
}

/// `onto` and a linear layer of x.
pub(crate) fn layer_onto<const D: usize>(layer: &Linear, x: Tensor<D>, onto: Tensor<D>) -> Tensor<D> {
    let (weight, bias) = (layer.weight.val(), layer.bias.as_ref().map(|bias| bias.val()));
    match in_squares(&x, &weight) {
        true => product(x, weight, bias, Some(onto)),
        false => onto + linear(x, weight, bias),
    }
}

/// `x weight + bias` of the last dimension of x: in one launch on a card where the weights are constants.
pub(crate) fn linear<const D: usize>(x: Tensor<D>, weight: Tensor<2>, bias: Option<Tensor<1>>) -> Tensor<D> {
    if in_squares(&x, &weight) {
        return product(x, weight, bias, None);
    }
    if !on_card(&x) || weight.is_require_grad() {
        return burn::tensor::module::linear(x, weight, bias);
    }
    let mut shape = x.dims();
    let out = affine(x.reshape([-1, weight.dims()[0] as i64]), None, weight, bias);
    shape[D - 1] = out.dims()[1];
    out.reshape(shape)
}

/// Whether a product with these weights is computed by squares of the output.
fn in_squares<const D: usize>(x: &Tensor<D>, weight: &Tensor<2>) -> bool {
    let rows = x.shape().num_elements() / weight.dims()[0];
    on_card(x) && !weight.is_require_grad() && rows >= MANY
}

/// `x weight + bias + onto`, of many rows.
fn product<const D: usize>(
    x: Tensor<D>,
    weight: Tensor<2>,
    bias: Option<Tensor<1>>,
    onto: Option<Tensor<D>>,
) -> Tensor<D> {
    let (biased, adding) = (bias.is_some(), onto.is_some());
    let weight = weight.into_dispatch();
    // What is not there is not read.
    let bias = bias.map_or_else(|| weight.clone(), Tensor::into_dispatch);
    let onto = onto.map_or_else(|| weight.clone(), Tensor::into_dispatch);
    Tensor::from_dispatch(Dispatch::many_rows(
        x.into_dispatch(),
        weight,
        bias,
        onto,
        biased,
        adding,
    ))
}

/// Rows `[b, n]` of length 1; of almost no length where `tiny`, squared, is not small beside them.
pub(crate) fn unit_rows(x: Tensor<2>, tiny: f32) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::rows_of_unit_length(x.into_dispatch(), tiny))
}

/// Pictures `[b, 3, h, w]` less `mean`, over `deviation`, by channel.
pub(crate) fn standardize(pictures: Tensor<4>, mean: [f32; 3], deviation: [f32; 3]) -> Tensor<4> {
    Tensor::from_dispatch(Dispatch::standardized(pictures.into_dispatch(), mean, deviation))
}

/// `temperature` times the mean binary cross-entropy of `logits / temperature` (`[b, n]`) for targets of 0 and 1, `[1, n]`,
/// that are constants: `[1]`.
pub(crate) fn cross_entropy(logits: Tensor<2>, targets: Tensor<2>, temperature: f32) -> Tensor<1> {
    let (logits, targets) = (logits.into_dispatch(), targets.into_dispatch());
    Tensor::from_dispatch(Dispatch::mean_cross_entropy(logits, targets, temperature))
}

/// Whether [`attend`] takes so many tokens, and numbers of a head.
pub(crate) fn attends(tokens: usize, dim: usize) -> bool {
    attention::fits(tokens, dim)
}

/// Scaled dot-product attention of tokens to each other, `[b, n, w]`, from queries, keys and values side by side,
/// `[b, n, 3 w]`; to themselves and those before them only if `causal`. [`attends`] says which sizes.
pub(crate) fn attend(qkv: Tensor<3>, heads: usize, causal: bool) -> Tensor<3> {
    Tensor::from_dispatch(Dispatch::attended(qkv.into_dispatch(), heads, causal))
}

/// Gaussian error linear units of every value, or if `quick` CLIP's approximation `x sigmoid(1.702 x)`.
pub(crate) fn gelu<const D: usize>(x: Tensor<D>, quick: bool) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::gaussian_units(x.into_dispatch(), quick))
}

#[cfg(test)]
mod tests;
