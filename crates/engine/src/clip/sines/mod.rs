//! Mean over a picture's pixels of the sine of a linear function of their colour, as one differentiable operation.
//!
//! `out[b][n] = sum over p of w[b][p] sin(filters[n] . pictures[b][:, p] + phases[n])`, where p are pixels or means of
//! squares of them, and weights w are alike or by how rare a colour is ([`density`]). Written with burn's tensors it takes
//! a number for every filter and pixel to memory and back several times, which was three quarters of the time of an embedding; here
//! a pixel is read once and its sines are added up where they are computed. The backward pass computes the cosines anew
//! instead of keeping the sines. Weights count as constants there: a mark moves colours by less than a cell of the grid
//! that they come from, and the gradient through them changes nothing that was measured.
//!
//! Both devices reduce the argument to a half turn by hand: arguments reach hundreds of radians, and a GPU's own sine
//! promises nothing there.
mod cpu;
mod density;
mod flex;
mod gpu;
mod kernel;
mod of_colours;
mod plain;
mod pool;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

pub(super) use of_colours::HostWaves;

/// 2 pi in two parts, for the GPU: multiples of the first by less than 2^15 are exact.
const TURN: [f32; 2] = [6.281_25, 1.935_307_2e-3];

/// Mean sines `[b, n]` of pictures `[b, 3, h, w]`, for filters `[n, 3]` and phases `[n]`: as many of each scale, which
/// averages over squares of a side of `sides` pixels first. A pixel weighs its colour's density to the power of minus
/// `equalization`, from 0 to 1, and at 0 all weigh alike. Differentiable in the pictures; filters, phases and weights are
/// constants. Good to 1e-5 for arguments of some hundreds of radians.
pub(super) fn mean_sines(
    pictures: Tensor<4>,
    filters: Tensor<2>,
    phases: Tensor<1>,
    sides: Vec<usize>,
    equalization: f32,
) -> Tensor<2> {
    let (filters, phases) = (filters.into_dispatch(), phases.into_dispatch());
    let means = Dispatch::mean_sines(pictures.into_dispatch(), filters, phases, sides, equalization);
    Tensor::from_dispatch(means)
}

/// The operation on every backend.
#[backend_extension(Autodiff, Cube, Flex)]
trait MeanSines: Backend {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> FloatTensor<Self>;
}

/// Its parts on a device.
trait WeightedSines: Backend {
    /// What the backward pass needs of the forward pass.
    type Kept: Clone + Send + std::fmt::Debug + 'static;

    /// The means.
    fn means(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> (FloatTensor<Self>, Self::Kept);

    /// Their gradient to the pictures, `[b, 3, h, w]`, for a gradient `[b, n]`.
    fn means_backward(kept: Self::Kept, gradient: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The backward step of the graph.
#[derive(Debug)]
struct ToPictures;

impl<B: WeightedSines> Backward<B, 1> for ToPictures {
    type State = B::Kept;

    fn backward(self, ops: Ops<Self::State, 1>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = gradients.consume::<B>(&ops.node);
        let [parent] = ops.parents;
        if let Some(parent) = parent {
            let found = B::means_backward(ops.state, gradient);
            gradients.register::<B>(parent.id, found);
        }
    }
}

impl<B: WeightedSines + MeanSines, C: CheckpointStrategy> MeanSines for Autodiff<B, C> {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> FloatTensor<Self> {
        let (pictures, node) = pictures.into_parts();
        let (filters, _) = filters.into_parts();
        let (phases, _) = phases.into_parts();
        let (out, kept) = B::means(pictures, filters, phases, sides, equalization);
        match ToPictures.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(graph) => graph.finish(kept, out),
            OpsKind::UnTracked(graph) => graph.finish(out),
        }
    }
}

#[cfg(test)]
mod tests;
