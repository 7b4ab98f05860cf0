//! Resampling along both axes of pictures as products with matrices, which runs at full speed on every device and whose
//! gradient is the same from run to run.
use burn::tensor::{Device, Tensor, TensorData};

/// How a line of pixels is resampled: `[to][from]`, each row the weights of one new pixel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lines {
    pub from: usize,
    pub to: usize,
    pub weights: Vec<f32>,
}

impl Lines {
    pub fn identity(side: usize) -> Self {
        let mut lines = Self::zero(side, side);
        for i in 0..side {
            lines.weights[i * side + i] = 1.0;
        }
        lines
    }

    pub fn zero(from: usize, to: usize) -> Self {
        Self {
            from,
            to,
            weights: vec![0.0; from * to],
        }
    }

    /// Bilinear with antialiasing, as torch's `interpolate(mode="bilinear", antialias=True, align_corners=False)`: a
    /// triangle, as wide as a new pixel where it shrinks. CLIP's preprocessing resizes in the same way.
    pub fn resize(from: usize, to: usize) -> Self {
        let mut lines = Self::zero(from, to);
        let scale = from as f64 / to as f64;
        let support = scale.max(1.0);
        for (i, row) in lines.weights.chunks_exact_mut(from).enumerate() {
            let centre = scale * (i as f64 + 0.5);
            let first = (centre - support + 0.5).max(0.0) as usize;
            let last = ((centre + support + 0.5) as usize).min(from);
            let triangle = |j: usize| (1.0 - ((j as f64 + 0.5 - centre) / support).abs()).max(0.0);
            let total: f64 = (first..last).map(triangle).sum();
            for j in first..last {
                row[j] = (triangle(j) / total) as f32;
            }
        }
        lines
    }

    /// This first, then `next`. Both are sparse, so only what is not zero is multiplied.
    pub fn then(&self, next: &Self) -> Self {
        let mut lines = Self::zero(self.from, next.to);
        let rows = lines.weights.chunks_exact_mut(self.from);
        for (row, taps) in rows.zip(next.weights.chunks_exact(next.from)) {
            let used = taps.iter().zip(self.weights.chunks_exact(self.from));
            for (tap, inner) in used.filter(|(tap, _)| **tap != 0.0) {
                for (sum, weight) in row.iter_mut().zip(inner) {
                    *sum += tap * weight;
                }
            }
        }
        lines
    }
}

/// Resamples pictures `[b, c, h, w]` along y and x. There is one of `ys` and `xs` for each picture, or one for all.
pub(crate) fn resample(pictures: Tensor<4>, ys: &[Lines], xs: &[Lines]) -> Tensor<4> {
    let device = pictures.device();
    // Along x first: rows of all channels lie one after the other.
    let pictures = pictures.matmul(stack(xs, &device).swap_dims(2, 3));
    stack(ys, &device).matmul(pictures)
}

/// `[n, 1, to, from]`; all lines have the size of the first.
fn stack(lines: &[Lines], device: &Device) -> Tensor<4> {
    let [from, to] = lines.first().map_or([0, 0], |l| [l.from, l.to]);
    let weights: Vec<f32> = lines.iter().flat_map(|l| l.weights.iter().copied()).collect();
    Tensor::from_data(TensorData::new(weights, [lines.len(), 1, to, from]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_every_pixel_sum_to_one() {
        for (from, to) in [(800, 224), (224, 224), (5, 224), (1, 7), (7, 1), (225, 224)] {
            let lines = Lines::resize(from, to);
            assert_eq!(lines.weights.len(), from * to);
            for row in lines.weights.chunks_exact(from) {
                assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{from} to {to}");
            }
        }
        assert_eq!(Lines::resize(9, 9), Lines::identity(9));
    }

    #[test]
    fn halving_averages_with_the_triangle() {
        // torch.nn.functional.interpolate(arange(8).float().view(1, 1, 1, 8), (1, 4), mode="bilinear", antialias=True)
        let lines = Lines::resize(8, 4);
        for (row, expected) in lines.weights.chunks_exact(8).zip([0.714_285_7, 2.5, 4.5, 6.285_714_6]) {
            let found: f32 = row.iter().enumerate().map(|(i, weight)| i as f32 * weight).sum();
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn two_in_a_row_are_their_product() {
        let both = Lines::resize(5, 3).then(&Lines::resize(3, 7));
        assert_eq!([both.from, both.to], [5, 7]);
        let (first, second) = (Lines::resize(5, 3), Lines::resize(3, 7));
        for to in 0..7 {
            for from in 0..5 {
                let sum: f32 = (0..3)
                    .map(|i| second.weights[to * 3 + i] * first.weights[i * 5 + from])
                    .sum();
                assert!((both.weights[to * 5 + from] - sum).abs() < 1e-6);
            }
        }
    }
}
