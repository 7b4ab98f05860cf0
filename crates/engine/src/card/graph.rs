//! The operations in a graph: how a gradient goes back through each.
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Cube};
use burn_cubecl::tensor::CubeTensor;

use super::attention::Attention;
use super::operations::CardOperations;
use super::{affine, cross_entropy, gelu, product, standardize, unit_rows};

/// How a gradient goes back through an operation.
#[derive(Clone, Debug)]
enum Kept {
    /// The weights.
    Affine(CubeTensor),
    /// The rows, and one over their lengths.
    UnitRows(Box<[CubeTensor; 2]>),
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
            Self::UnitRows(kept) => {
                let [rows, scales] = *kept;
                unit_rows::backward(gradient, rows, scales)
            }
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

/// The backward step of a product and of what it is added to, if that has a gradient.
#[derive(Debug)]
struct ToBoth;

impl Backward<Cube, 2> for ToBoth {
    /// The weights.
    type State = CubeTensor;

    fn backward(self, ops: Ops<CubeTensor, 2>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = gradients.consume::<Cube>(&ops.node);
        let [x, onto] = ops.parents;
        if let Some(x) = x {
            gradients.register::<Cube>(x.id, product::backward(gradient.clone(), ops.state));
        }
        if let Some(onto) = onto {
            gradients.register::<Cube>(onto.id, gradient);
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
        onto: FloatTensor<Self>,
        biased: bool,
        adding: bool,
    ) -> FloatTensor<Self> {
        let [(weight, _), (bias, _)] = [weight, bias].map(|constant| constant.into_parts());
        let [(x, of_x), (onto, of_onto)] = [x, onto].map(|input| input.into_parts());
        let out = Cube::many_rows(x, weight.clone(), bias, onto, biased, adding);
        match ToBoth.prepare::<C>([of_x, of_onto]).compute_bound().stateful() {
            OpsKind::Tracked(graph) => graph.finish(weight, out),
            OpsKind::UnTracked(graph) => graph.finish(out),
        }
    }

    fn rows_of_unit_length(x: FloatTensor<Self>, tiny: f32) -> FloatTensor<Self> {
        tracked::<C>(x, |x| {
            let (out, scales) = unit_rows::forward(x, tiny);
            (out.clone(), Kept::UnitRows(Box::new([out, scales])))
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
