//! Layer normalisation (Ba et al. 2016) as one differentiable operation: on a card two launches, where burn's takes some forty.
//!
//! `y = (x - mean) / sqrt(variance + epsilon) * gamma + beta`, with mean and variance over the last dimension. The gradient
//! goes to x alone: a CLIP is not trained here.
mod flex;
mod gpu;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use super::params::param;

/// A normalisation of tokens. Fields are named as in burn's own, by which weights are found.
#[derive(Module, Debug)]
pub struct LayerNorm {
    gamma: Param<Tensor<1>>,
    beta: Param<Tensor<1>>,
    #[module(skip)]
    epsilon: f64,
}

impl LayerNorm {
    /// Of tokens of `width`.
    pub fn new(width: usize, epsilon: f64, device: &Device) -> Self {
        Self {
            gamma: param([width], device),
            beta: param([width], device),
            epsilon,
        }
    }

    /// Normalises the last dimension.
    pub fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        let (gamma, beta) = (self.gamma.val().into_dispatch(), self.beta.val().into_dispatch());
        let normal = Dispatch::layer_normalized(x.into_dispatch(), gamma, beta, self.epsilon as f32);
        Tensor::from_dispatch(normal)
    }
}

/// The operation on every backend.
#[backend_extension(Autodiff, Cube, Flex)]
trait LayerNormalized: Backend {
    fn layer_normalized(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self>;
}

/// Its parts on a device.
trait Normalization: Backend {
    /// Normalised rows, and of each row its mean and one over its deviation, `[rows, 2]`.
    fn normalize(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> [FloatTensor<Self>; 2];

    /// The gradient to x.
    fn normalize_backward(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        moments: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// The backward step of the graph.
#[derive(Debug)]
struct ToInput;

impl<B: Normalization> Backward<B, 1> for ToInput {
    /// x, gamma and the moments.
    type State = [FloatTensor<B>; 3];

    fn backward(self, ops: Ops<Self::State, 1>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = gradients.consume::<B>(&ops.node);
        let [x, gamma, moments] = ops.state;
        let [parent] = ops.parents;
        if let Some(parent) = parent {
            let found = B::normalize_backward(x, gamma, moments, gradient);
            gradients.register::<B>(parent.id, found);
        }
    }
}

impl<B: Normalization + LayerNormalized, C: CheckpointStrategy> LayerNormalized for Autodiff<B, C> {
    fn layer_normalized(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let (gamma, _) = gamma.into_parts();
        let (beta, _) = beta.into_parts();
        let [out, moments] = B::normalize(x.clone(), gamma.clone(), beta, epsilon);
        match ToInput.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(graph) => graph.finish([x, gamma, moments], out),
            OpsKind::UnTracked(graph) => graph.finish(out),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{DeviceChoice, open};
    use crate::testing::wgpu;
    use burn::tensor::TensorData;

    const ROWS: usize = 7;

    /// Numbers, means of which are far from 0 beside their deviations in every second row.
    fn numbers(count: usize, width: usize, seed: usize) -> Vec<f32> {
        let of = |i: usize| ((i * 37 + seed * 11) % 41) as f32 / 20.0 - 1.0;
        (0..count).map(|i| of(i) + (i / width % 2) as f32 * 3.0).collect()
    }

    /// Normalised rows and the gradient to x, in f64.
    fn reference(x: &[f32], gamma: &[f32], beta: &[f32], gradient: &[f32], epsilon: f64) -> [Vec<f64>; 2] {
        let width = gamma.len();
        let (mut out, mut to_x) = (Vec::new(), Vec::new());
        for (x, g) in x.chunks_exact(width).zip(gradient.chunks_exact(width)) {
            let x: Vec<f64> = x.iter().map(|x| f64::from(*x)).collect();
            let mean = |of: &[f64]| of.iter().sum::<f64>() / width as f64;
            let centre = mean(&x);
            let variance = mean(&x.iter().map(|x| (x - centre).powi(2)).collect::<Vec<_>>());
            let scale = (variance + epsilon).sqrt().recip();
            let normal: Vec<f64> = x.iter().map(|x| (x - centre) * scale).collect();
            let weighed: Vec<f64> = g.iter().zip(gamma).map(|(g, w)| f64::from(g * w)).collect();
            let along = mean(&normal.iter().zip(&weighed).map(|(n, w)| n * w).collect::<Vec<_>>());
            let level = mean(&weighed);
            for k in 0..width {
                out.push(normal[k] * f64::from(gamma[k]) + f64::from(beta[k]));
                to_x.push(scale * (weighed[k] - level - normal[k] * along));
            }
        }
        [out, to_x]
    }

    fn agrees(device: &Device, width: usize) {
        let device = device.clone().autodiff();
        let [x, gradient] = [1, 2].map(|seed| numbers(ROWS * width, width, seed));
        let [gamma, beta] = [3, 4].map(|seed| numbers(width, width, seed));
        let tensor = |values: &[f32]| Tensor::<1>::from_data(TensorData::new(values.to_vec(), [values.len()]), &device);
        let norm = LayerNorm {
            gamma: Param::from_tensor(tensor(&gamma)),
            beta: Param::from_tensor(tensor(&beta)),
            epsilon: 1e-3,
        };
        let input = tensor(&x).reshape([1, ROWS, width]).require_grad();
        let out = norm.forward(input.clone());
        let found = (out.clone() * tensor(&gradient).reshape([1, ROWS, width]))
            .sum()
            .backward();
        let found = [out.into_data(), input.grad(&found).unwrap().into_data()];
        let want = reference(&x, &gamma, &beta, &gradient, 1e-3);
        for (found, want) in found.iter().zip(want) {
            let largest = want.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let off = found.iter::<f32>().zip(&want).map(|(a, b)| (f64::from(a) - b).abs());
            let off = off.fold(0.0_f64, f64::max);
            assert!(largest > 0.0 && off < 1e-4 * largest, "{width}: {off} of {largest}");
        }
    }

    #[test]
    fn rows_and_gradients_are_those_of_the_formula() {
        for width in [3, 8, 300, 768] {
            agrees(&open(DeviceChoice::Cpu).unwrap().device, width);
        }
        if let Some(compute) = wgpu() {
            [3, 8, 300, 768]
                .into_iter()
                .for_each(|width| agrees(&compute.device, width));
        }
    }
}
