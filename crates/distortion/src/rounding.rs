//! Rounding that lets gradients through, and the 8 bits in which pictures are stored.
use burn::tensor::Tensor;

/// Rounds to whole numbers (half to even); the gradient is that of the identity (Bengio et al. 2013, straight-through).
pub(crate) fn round_straight_through<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    let still = x.clone().detach();
    let change = still.clone().round() - still;
    x + change
}

/// Pictures in [0, 1] as 8 bits a value hold them: multiples of 1/255.
pub(crate) fn eight_bit(pictures: Tensor<4>) -> Tensor<4> {
    round_straight_through(pictures.clamp(0.0, 1.0) * 255.0) / 255.0
}
