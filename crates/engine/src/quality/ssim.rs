//! Structural similarity (Wang et al. 2004): 11 x 11 Gaussian window of sigma 1.5 a channel, zero padding,
//! C1 = 0.01^2, C2 = 0.03^2, data range 1. Differentiable; the loss and the metric are the same code.
//!
//! The window is separable, so a blur is B_h X B_w^T with banded matrices. As dense products these run at full speed on
//! every device, which small convolutions do not.
use burn::tensor::{Device, Tensor, TensorData};

use super::batch::comparable;
use super::likeness::mean_ssim;
use super::window::{RADIUS, weight};
use crate::error::Result;
use crate::picture::Picture;

pub(super) const C1: f32 = 0.01 * 0.01;
pub(super) const C2: f32 = 0.03 * 0.03;

/// Blur matrices for pictures of one size on one device.
#[derive(Clone, Debug)]
pub struct Ssim {
    /// height x height, symmetric.
    rows: Tensor<2>,
    /// width x width, symmetric.
    columns: Tensor<2>,
}

/// The n x n matrix of a Gaussian window with zeros beyond the border.
fn band(n: usize, device: &Device) -> Tensor<2> {
    let mut matrix = vec![0.0_f32; n * n];
    for i in 0..n {
        for j in i.saturating_sub(RADIUS)..n.min(i + RADIUS + 1) {
            matrix[i * n + j] = weight(i.abs_diff(j)) as f32;
        }
    }
    Tensor::from_data(TensorData::new(matrix, [n, n]), device)
}

impl Ssim {
    /// For pictures of `height` x `width` pixels.
    pub fn new(height: usize, width: usize, device: &Device) -> Self {
        let device = device.clone().without_autodiff();
        Self {
            rows: band(height, &device),
            columns: band(width, &device),
        }
    }

    /// Blurs `[b, 3, h, w]`; the result is `[b, 3, w, h]`, because what follows works pixel by pixel and one
    /// transposition is saved.
    fn blur(&self, x: Tensor<4>) -> Tensor<4> {
        let [b, c, h, w] = x.dims();
        let x = x.reshape([b * c * h, w]).matmul(self.columns.clone());
        let x = x.reshape([b, c, h, w]).swap_dims(2, 3).reshape([b * c * w, h]);
        x.matmul(self.rows.clone()).reshape([b, c, w, h])
    }

    /// SSIM of each view, `[b]`, of pictures `[b, 3, h, w]` in [0, 1] of the size this was made for; differentiable in
    /// both.
    pub fn per_view(&self, original: Tensor<4>, marked: Tensor<4>) -> Tensor<1> {
        let [b, c, h, w] = original.dims();
        let (mu_x, mu_y) = (self.blur(original.clone()), self.blur(marked.clone()));
        let (mu_xx, mu_yy, mu_xy) = (mu_x.clone().square(), mu_y.clone().square(), mu_x * mu_y);
        let var_x = self.blur(original.clone().square()) - mu_xx.clone();
        let var_y = self.blur(marked.clone().square()) - mu_yy.clone();
        let covariance = self.blur(original * marked) - mu_xy.clone();
        let numerator = (mu_xy * 2.0 + C1) * (covariance * 2.0 + C2);
        let denominator = (mu_xx + mu_yy + C1) * (var_x + var_y + C2);
        (numerator / denominator)
            .reshape([b, c * h * w])
            .mean_dim(1)
            .reshape([b])
    }

    /// Mean SSIM over the views of a batch, one number: the loss is 1 minus it.
    pub fn mean(&self, original: Tensor<4>, marked: Tensor<4>) -> Tensor<1> {
        self.per_view(original, marked).mean()
    }
}

/// SSIM of two pictures of one size, the mean over pixels and colours. Fails when sizes differ and on pictures without
/// pixels.
pub fn ssim(original: &Picture, marked: &Picture) -> Result<f64> {
    comparable(&[original, marked])?;
    Ok(mean_ssim(original, marked))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::quality::batch;

    fn random(width: u32, height: u32, seed: u64) -> Picture {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Picture {
            width,
            height,
            pixels: (0..width * height * 3).map(|_| rng.random()).collect(),
        }
    }

    fn noisy(picture: &Picture, amount: f32, seed: u64) -> Picture {
        let noise = random(picture.width, picture.height, seed);
        let pixels = picture
            .pixels
            .iter()
            .zip(&noise.pixels)
            .map(|(p, n)| p + amount * (n - 0.5))
            .collect();
        Picture { pixels, ..*picture }
    }

    /// The definition, window by window, in f64.
    fn reference(a: &Picture, b: &Picture) -> f64 {
        let (w, h) = (a.width as i64, a.height as i64);
        let g = |d: i64| (-(d * d) as f64 / 4.5).exp();
        let total: f64 = (-5..=5).map(g).sum::<f64>();
        let mut sum = 0.0;
        for c in 0..3 {
            for y in 0..h {
                for x in 0..w {
                    let mut m = [0.0; 5];
                    for v in (y - 5).max(0)..(y + 6).min(h) {
                        for u in (x - 5).max(0)..(x + 6).min(w) {
                            let weight = g(u - x) * g(v - y) / (total * total);
                            let at = ((v * w + u) * 3 + c) as usize;
                            let (p, q) = (f64::from(a.pixels[at]), f64::from(b.pixels[at]));
                            for (m, value) in m.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                                *m += weight * value;
                            }
                        }
                    }
                    let [p, q, pp, qq, pq] = m;
                    let (c1, c2) = (1e-4, 9e-4);
                    sum += (2.0 * p * q + c1) * (2.0 * (pq - p * q) + c2)
                        / ((p * p + q * q + c1) * (pp - p * p + qq - q * q + c2));
                }
            }
        }
        sum / (3 * w * h) as f64
    }

    #[test]
    fn agrees_with_the_definition() {
        for (w, h, amount) in [(23, 17, 0.2), (4, 30, 0.5), (1, 1, 0.1)] {
            let a = random(w, h, 1);
            let b = noisy(&a, amount, 2);
            let (value, expected) = (ssim(&a, &b).unwrap(), reference(&a, &b));
            assert!((value - expected).abs() < 1e-5, "{w} x {h}: {value} {expected}");
        }
    }

    #[test]
    fn identical_and_constant_pictures_have_one_and_noise_lowers_it() {
        let a = random(32, 32, 3);
        assert!((ssim(&a, &a).unwrap() - 1.0).abs() < 1e-6);
        for value in [0.0, 0.5, 1.0] {
            let grey = Picture {
                pixels: vec![value; 32 * 32 * 3],
                ..a
            };
            assert!((ssim(&grey, &grey).unwrap() - 1.0).abs() < 1e-5);
        }
        let falling: Vec<f64> = [0.0, 0.1, 0.3, 0.9]
            .iter()
            .map(|&n| ssim(&a, &noisy(&a, n, 4)).unwrap())
            .collect();
        assert!(falling.windows(2).all(|w| w[0] > w[1]), "{falling:?}");
        assert!(ssim(&a, &random(16, 32, 1)).is_err());
    }

    #[test]
    fn gradient_agrees_with_central_differences() {
        let device = Device::flex().autodiff();
        let (a, b) = (random(9, 7, 5), random(9, 7, 6));
        let original = batch(&[&a], &device).unwrap();
        let marked = batch(&[&b], &device).unwrap().require_grad();
        let metric = Ssim::new(7, 9, &device);
        let gradients = metric.mean(original.clone(), marked.clone()).backward();
        let gradient = super::super::unbatch(marked.grad(&gradients).unwrap())
            .unwrap()
            .remove(0);
        for at in [0, 50, 94, 188] {
            let value = |step: f32| {
                let mut moved = b.clone();
                moved.pixels[at] += step;
                reference(&a, &moved)
            };
            let slope = (value(1e-3) - value(-1e-3)) / 2e-3;
            let got = f64::from(gradient.pixels[at]);
            assert!((got - slope).abs() < 2e-5 + 0.01 * slope.abs(), "{at}: {got} {slope}");
        }
    }

    #[test]
    fn views_of_a_batch_are_independent() {
        let device = Device::flex();
        let (a, b, c) = (random(12, 10, 1), random(12, 10, 2), random(12, 10, 3));
        let metric = Ssim::new(10, 12, &device);
        let left = batch(&[&a, &b], &device).unwrap();
        let right = batch(&[&b, &c], &device).unwrap();
        let both = metric.per_view(left, right).try_into_vec_as::<f32>().unwrap();
        for (value, (x, y)) in both.iter().zip([(&a, &b), (&b, &c)]) {
            assert!((f64::from(*value) - ssim(x, y).unwrap()).abs() < 1e-6);
        }
    }
}
