//! More or less contrast, as torchvision's `adjust_contrast`.
use burn::tensor::{Tensor, TensorData};

use crate::groups::one_each;

/// Luma weights of ITU-R BT.601, as torchvision's `rgb_to_grayscale` has them.
const GREY: [f32; 3] = [0.2989, 0.587, 0.114];

/// Blends pictures `[b, 3, h, w]` with the mean of their grey: `f x + (1 - f) mean`, clamped to [0, 1]. A factor of 0
/// leaves the mean, 1 the picture.
pub(crate) fn contrast(pictures: Tensor<4>, factors: &[f32]) -> Tensor<4> {
    let [b, _, h, w] = pictures.dims();
    let device = pictures.device();
    let factors = one_each(factors.iter().copied(), &device);
    let weights = Tensor::<4>::from_data(TensorData::new(GREY.to_vec(), [1, 3, 1, 1]), &device);
    let means = pictures
        .clone()
        .reshape([b, 3, h * w])
        .mean_dim(2)
        .reshape([b, 3, 1, 1]);
    let mean = (means * weights).sum_dim(1);
    (pictures * factors.clone() + mean * (-factors + 1.0)).clamp(0.0, 1.0)
}
