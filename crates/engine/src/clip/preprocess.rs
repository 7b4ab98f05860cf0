//! From pictures of any size to the image tower's input: resized to a square, then mean and deviation.
use burn::tensor::Tensor;

use super::config::Normalization;
use crate::card::{on_card, standardize};
use crate::resize::resize;

/// Resizes `[b, 3, h, w]` to `[b, 3, size, size]` (the aspect is squashed) and normalises the channels.
pub fn preprocess(pictures: Tensor<4>, size: usize, normalization: &Normalization) -> Tensor<4> {
    normalized(resize(pictures, size, size), normalization)
}

/// Pictures `[b, 3, h, w]` with mean and deviation of their channels removed.
pub fn normalized(pictures: Tensor<4>, normalization: &Normalization) -> Tensor<4> {
    if on_card(&pictures) {
        return standardize(pictures, normalization.mean, normalization.std);
    }
    let device = pictures.device();
    let channels = |values: [f32; 3]| Tensor::<1>::from_floats(values, &device).reshape([1, 3, 1, 1]);
    (pictures - channels(normalization.mean)) / channels(normalization.std)
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;

    fn values(t: Tensor<4>) -> Vec<f32> {
        t.into_data().iter::<f32>().collect()
    }

    #[test]
    fn a_picture_of_the_right_size_is_only_normalised() {
        let normalization = Normalization {
            mean: [0.5; 3],
            std: [0.25; 3],
        };
        let x = Tensor::<4>::ones([1, 3, 8, 8], &Device::flex());
        assert!(values(preprocess(x, 8, &normalization)).iter().all(|v| *v == 2.0));
    }
}
