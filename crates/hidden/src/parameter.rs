//! Seeded numbers, and tensors that are trained where the device tracks gradients.
use burn::module::{Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

/// Uniform in [0, 1), from 24 bits; our own so that seeds mean the same with every release of `rand`.
pub(crate) fn unit(rng: &mut impl Rng) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1_u32 << 24) as f32
}

/// Uniform in [`low`, `high`).
pub(crate) fn uniform(rng: &mut impl Rng, low: f32, high: f32) -> f32 {
    low + (high - low) * unit(rng)
}

/// `count` numbers uniform in +-`bound`.
pub(crate) fn draw(rng: &mut impl Rng, count: usize, bound: f32) -> Vec<f32> {
    (0..count).map(|_| uniform(rng, -bound, bound)).collect()
}

/// A parameter of `shape` (its product is the number of values) on `device`.
pub(crate) fn parameter<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    let tensor = Tensor::from_data(TensorData::new(values.to_vec(), shape), device);
    let tensor = if tensor.is_autodiff() {
        tensor.require_grad()
    } else {
        tensor
    };
    Param::initialized(ParamId::new(), tensor)
}
