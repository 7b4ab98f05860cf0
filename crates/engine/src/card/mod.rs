//! What a card does in one launch where a graph of tensors takes several: each launch costs the host some forty microseconds,
//! which is more than a card needs for most of them.
//!
//! The CPU device computes the same by burn's tensors; callers ask [`on_card`] which of both it is.
mod affine;
mod attention;
mod cross_entropy;
mod gelu;
mod product;
mod standardize;
mod unit_rows;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Cube, Dispatch, DispatchDevice, backend_extension};
use burn::nn::Linear;
use burn::tensor::Tensor;
use burn_cubecl::tensor::CubeTensor;

use self::attention::Attention;

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

/// `x weight + bias` of the last dimension of x: in one launch on a card where the weights are constants.
pub(crate) fn linear<const D: usize>(x: Tensor<D>, weight: Tensor<2>, bias: Option<Tensor<1>>) -> Tensor<D> {
    if !on_card(&x) || weight.is_require_grad() {
        return burn::tensor::module::linear(x, weight, bias);
    }
    let rows = x.shape().num_elements() / weight.dims()[0];
    if rows < MANY {
        let mut shape = x.dims();
        let out = affine(x.reshape([rows as i64, -1]), None, weight, bias);
        shape[D - 1] = out.dims()[1];
        return out.reshape(shape);
    }
    let (biased, weight) = (bias.is_some(), weight.into_dispatch());
    // What is not there is not read.
    let bias = bias.map_or_else(|| weight.clone(), Tensor::into_dispatch);
    Tensor::from_dispatch(Dispatch::many_rows(x.into_dispatch(), weight, bias, biased))
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

/// Scaled dot-product attention of tokens to each other, `[b, n, w]`, from queries, keys and values side by side, `[b, n, 3 w]`; to
/// themselves and those before them only if `causal`. [`attends`] says which sizes.
pub(crate) fn attend(qkv: Tensor<3>, heads: usize, causal: bool) -> Tensor<3> {
    Tensor::from_dispatch(Dispatch::attended(qkv.into_dispatch(), heads, causal))
}

/// Gaussian error linear units of every value, or if `quick` CLIP's approximation `x sigmoid(1.702 x)`.
pub(crate) fn gelu<const D: usize>(x: Tensor<D>, quick: bool) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::gaussian_units(x.into_dispatch(), quick))
}

/// The operations, on a card alone.
#[backend_extension(Autodiff, Cube)]
trait CardOperations: Backend {
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
        biased: bool,
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
        biased: bool,
    ) -> FloatTensor<Self> {
        product::forward(x, weight, biased.then_some(bias))
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

/// How a gradient goes back through an operation.
#[derive(Clone, Debug)]
enum Kept {
    /// The weights.
    Affine(CubeTensor),
    /// The weights.
    Product(CubeTensor),
    /// The rows, and one over their lengths.
    UnitRows(CubeTensor, CubeTensor),
    /// The deviations.
    Standardized([f32; 3]),
    /// The gradient to the logits.
    CrossEntropy(CubeTensor),
    /// Queries, keys and values.
    Attention(Attention, CubeTensor),
    /// The values, and whether they were approximated.
    Gelu(CubeTensor, bool),
}

impl Kept {
    fn backward(self, gradient: CubeTensor) -> CubeTensor {
        match self {
            Self::Affine(weight) => affine::backward(gradient, weight),
            Self::Product(weight) => product::backward(gradient, weight),
            Self::UnitRows(rows, scales) => unit_rows::backward(gradient, rows, scales),
            Self::Standardized(deviation) => standardize::scaled(gradient, [0.0; 3], deviation),
            Self::CrossEntropy(to_logits) => cross_entropy::backward(gradient, to_logits),
            Self::Attention(attention, qkv) => attention.backward(gradient, qkv),
            Self::Gelu(x, quick) => gelu::backward(gradient, x, quick),
        }
    }
}

/// The backward step of the graph.
#[derive(Debug)]
struct ToInput;

impl Backward<Cube, 1> for ToInput {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 1>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = gradients.consume::<Cube>(&ops.node);
        let [parent] = ops.parents;
        if let Some(parent) = parent {
            gradients.register::<Cube>(parent.id, ops.state.backward(gradient));
        }
    }
}

/// Puts an operation on a tensor that may have a gradient into its graph.
fn tracked<C: CheckpointStrategy>(
    x: FloatTensor<Autodiff<Cube, C>>,
    compute: impl FnOnce(CubeTensor) -> (CubeTensor, Kept),
) -> FloatTensor<Autodiff<Cube, C>> {
    let (x, node) = x.into_parts();
    let (out, kept) = compute(x);
    match ToInput.prepare::<C>([node]).compute_bound().stateful() {
        OpsKind::Tracked(graph) => graph.finish(kept, out),
        OpsKind::UnTracked(graph) => graph.finish(out),
    }
}

impl<C: CheckpointStrategy> CardOperations for Autodiff<Cube, C> {
    fn affine_rows(
        x: FloatTensor<Self>,
        mean: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        centred: bool,
        biased: bool,
    ) -> FloatTensor<Self> {
        let [(mean, _), (weight, _), (bias, _)] = [mean, weight, bias].map(|constant| constant.into_parts());
        tracked::<C>(x, |x| {
            let out = Cube::affine_rows(x, mean, weight.clone(), bias, centred, biased);
            (out, Kept::Affine(weight))
        })
    }

    fn many_rows(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        biased: bool,
    ) -> FloatTensor<Self> {
        let [(weight, _), (bias, _)] = [weight, bias].map(|constant| constant.into_parts());
        tracked::<C>(x, |x| {
            let out = Cube::many_rows(x, weight.clone(), bias, biased);
            (out, Kept::Product(weight))
        })
    }

    fn rows_of_unit_length(x: FloatTensor<Self>, tiny: f32) -> FloatTensor<Self> {
        tracked::<C>(x, |x| {
            let (out, scales) = unit_rows::forward(x, tiny);
            (out.clone(), Kept::UnitRows(out, scales))
        })
    }

    fn standardized(pictures: FloatTensor<Self>, mean: [f32; 3], deviation: [f32; 3]) -> FloatTensor<Self> {
        tracked::<C>(pictures, |pictures| {
            (
                Cube::standardized(pictures, mean, deviation),
                Kept::Standardized(deviation),
            )
        })
    }

    fn mean_cross_entropy(
        logits: FloatTensor<Self>,
        targets: FloatTensor<Self>,
        temperature: f32,
    ) -> FloatTensor<Self> {
        let (targets, _) = targets.into_parts();
        tracked::<C>(logits, |logits| {
            let (out, to_logits) = cross_entropy::forward(logits, targets, temperature);
            (out, Kept::CrossEntropy(to_logits))
        })
    }

    fn attended(qkv: FloatTensor<Self>, heads: usize, causal: bool) -> FloatTensor<Self> {
        let attention = Attention { heads, causal };
        tracked::<C>(qkv, |qkv| {
            (attention.forward(qkv.clone()), Kept::Attention(attention, qkv))
        })
    }

    fn gaussian_units(x: FloatTensor<Self>, quick: bool) -> FloatTensor<Self> {
        tracked::<C>(x, |x| (gelu::forward(x.clone(), quick), Kept::Gelu(x, quick)))
    }
}

#[cfg(test)]
mod tests;
