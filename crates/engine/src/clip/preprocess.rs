//! From pictures of any size to the image tower's input: antialiased bilinear resize to a square, then mean and deviation.
use super::config::Normalization;
use burn::tensor::{Device, Tensor, TensorData};

/// Resizes `[b, 3, h, w]` to `[b, 3, size, size]` (the aspect is squashed) and normalises the channels.
pub fn preprocess(pictures: Tensor<4>, size: usize, normalization: &Normalization) -> Tensor<4> {
    normalized(resize(pictures, size, size), normalization)
}

/// Pictures `[b, 3, h, w]` with mean and deviation of their channels removed.
pub fn normalized(pictures: Tensor<4>, normalization: &Normalization) -> Tensor<4> {
    let device = pictures.device();
    let channels = |values: [f32; 3]| Tensor::<1>::from_floats(values, &device).reshape([1, 3, 1, 1]);
    (pictures - channels(normalization.mean)) / channels(normalization.std)
}

/// Antialiased bilinear resize of `[b, c, h, w]` to `[b, c, height, width]`, equal to torch's
/// `interpolate(mode="bilinear", antialias=True, align_corners=False)`.
///
/// Written as two products with fixed matrices, so it is differentiable and the same on every device.
pub fn resize(pictures: Tensor<4>, height: usize, width: usize) -> Tensor<4> {
    let [batch, channels, h, w] = pictures.dims();
    let device = pictures.device();
    let mut x = pictures;
    if w != width {
        // One product over all rows of all pictures.
        let flat = x
            .reshape([batch * channels * h, w])
            .matmul(weights(w, width, &device).transpose());
        x = flat.reshape([batch, channels, h, width]);
    }
    if h != height {
        x = weights(h, height, &device).unsqueeze::<4>().matmul(x);
    }
    x
}

/// `[to, from]`: how much each input contributes to each output along one axis. A triangle filter, widened by the
/// scale when shrinking (torch's `_upsample_bilinear2d_aa`).
fn weights(from: usize, to: usize, device: &Device) -> Tensor<2> {
    let scale = from as f64 / to as f64;
    let support = scale.max(1.0);
    let mut matrix = vec![0.0f32; to * from];
    for (i, row) in matrix.chunks_exact_mut(from).enumerate() {
        let centre = scale * (i as f64 + 0.5);
        let first = (centre - support + 0.5).max(0.0) as usize;
        let last = ((centre + support + 0.5) as usize).min(from);
        let triangle = |j: usize| (1.0 - ((j as f64 - centre + 0.5) / support).abs()).max(0.0);
        let total: f64 = (first..last).map(triangle).sum();
        for j in first..last {
            row[j] = (triangle(j) / total) as f32;
        }
    }
    Tensor::from_data(TensorData::new(matrix, [to, from]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(t: Tensor<4>) -> Vec<f32> {
        t.into_data().iter::<f32>().collect()
    }

    #[test]
    fn weights_of_every_output_sum_to_one() {
        for (from, to) in [(800, 224), (224, 224), (5, 224), (1, 7), (7, 1), (225, 224)] {
            let sums = weights(from, to, &Device::flex()).sum_dim(1).into_data();
            assert!(sums.iter::<f32>().all(|s| (s - 1.0).abs() < 1e-5), "{from} to {to}");
        }
    }

    #[test]
    fn halving_averages_with_the_triangle_filter() {
        // torch.nn.functional.interpolate(arange(8).float().view(1, 1, 1, 8), (1, 4), mode="bilinear", antialias=True)
        let x = Tensor::<1>::from_floats([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], &Device::flex());
        let found = values(resize(x.reshape([1, 1, 1, 8]), 1, 4));
        for (found, expected) in found.iter().zip([0.7142857, 2.5, 4.5, 6.2857146]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
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
