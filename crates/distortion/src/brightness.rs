//! Brighter or darker pictures, as torchvision's `adjust_brightness`.
use burn::tensor::Tensor;

use crate::groups::one_each;

/// Pictures `[b, 3, h, w]` times one factor each, clamped to [0, 1]. No gradient passes where it clamps, as nothing of
/// a mark is left there.
pub(crate) fn brightness(pictures: Tensor<4>, factors: &[f32]) -> Tensor<4> {
    let factors = one_each(factors.iter().copied(), &pictures.device());
    (pictures * factors).clamp(0.0, 1.0)
}
