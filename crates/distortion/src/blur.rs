//! Gaussian blur with a window of three pixels, as torchvision's `gaussian_blur(kernel_size=3)`.
use burn::tensor::Tensor;

use crate::matrices::{Lines, resample};

/// The deviation that torchvision takes for a window of three pixels if none is given: 0.3 ((k - 1) / 2 - 1) + 0.8.
pub const DEFAULT_SIGMA: f32 = 0.8;

/// Blurs pictures `[b, 3, h, w]`, each with its own deviation in pixels. Beyond the border the picture is mirrored
/// without repeating the border; 0 changes nothing.
pub(crate) fn blur(pictures: Tensor<4>, sigmas: &[f32]) -> Tensor<4> {
    let [_, _, h, w] = pictures.dims();
    // Often all have the same, and one matrix serves them.
    let sigmas = match sigmas {
        [first, rest @ ..] if rest.iter().all(|sigma| sigma == first) => &sigmas[..1],
        _ => sigmas,
    };
    let lines = |side| -> Vec<_> { sigmas.iter().map(|&sigma| window(side, sigma)).collect() };
    resample(pictures, &lines(h), &lines(w))
}

/// Three weights of a Gaussian along a line of `side` pixels.
fn window(side: usize, sigma: f32) -> Lines {
    let beside = (-0.5 / (f64::from(sigma) * f64::from(sigma))).exp();
    let total = 1.0 + 2.0 * beside;
    let mut lines = Lines::zero(side, side);
    for i in 0..side {
        let row = &mut lines.weights[i * side..(i + 1) * side];
        row[i] += (1.0 / total) as f32;
        // A line of one pixel has no neighbour to mirror.
        let before = if i > 0 { i - 1 } else { 1.min(side - 1) };
        let after = if i + 1 < side { i + 1 } else { i.saturating_sub(1) };
        row[before] += (beside / total) as f32;
        row[after] += (beside / total) as f32;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_torchvisions() {
        // torchvision.transforms.functional._get_gaussian_kernel1d(3, 0.8)
        let expected = [0.238_994_24, 0.522_011_5, 0.238_994_24];
        let lines = window(5, DEFAULT_SIGMA);
        for (weight, expected) in lines.weights[2 * 5 + 1..].iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-6, "{weight} {expected}");
        }
        // The second pixel is mirrored at the border.
        assert!((lines.weights[1] - 2.0 * expected[0]).abs() < 1e-6);
        assert_eq!(window(7, 0.0), Lines::identity(7));
        assert!((window(1, 2.0).weights[0] - 1.0).abs() < 1e-6);
    }
}
