//! Learned perceptual similarity (Zhang et al. 2018), AlexNet, version 0.1; differentiable.
//!
//! The metric is defined on pictures in [-1, 1]; pictures here are in [0, 1] and scaled inside.
use std::path::Path;

use burn::tensor::activation::relu;
use burn::tensor::module::{conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor, TensorData};

use super::lpips_weights::{self, CONVOLUTIONS, StageWeights};
use crate::error::{Error, Result};

/// Smallest width and height that leave a pixel after both poolings.
pub const MINIMUM_SIZE: usize = 31;
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
const EPSILON: f32 = 1e-10;

struct Stage {
    weight: Tensor<4>,
    bias: Tensor<1>,
    /// The linear head, `[1, channels, 1, 1]`.
    head: Tensor<4>,
}

/// AlexNet's five convolutions and the heads that weigh their differences, frozen on a device.
pub struct Lpips {
    stages: Vec<Stage>,
    shift: Tensor<4>,
    scale: Tensor<4>,
}

/// What [`Lpips`] compares: unit-length features at every position of five layers.
#[derive(Clone)]
pub struct Features(Vec<Tensor<4>>);

impl Lpips {
    /// Loads `lpips_alex_v0.1.safetensors`. Fails with [`Error::BadModel`] unless every tensor is
    /// there, f32, finite and of its shape.
    pub fn load(path: &Path, device: &Device) -> Result<Self> {
        Ok(Self::new(lpips_weights::read(path)?, device))
    }

    /// The same from a file's bytes; `Err` is the reason why not.
    pub fn from_bytes(bytes: &[u8], device: &Device) -> Result<Self, String> {
        Ok(Self::new(lpips_weights::parse(bytes)?, device))
    }

    fn new(weights: Vec<StageWeights>, device: &Device) -> Self {
        let device = &device.clone().without_autodiff();
        let stages = weights.into_iter().zip(CONVOLUTIONS).map(|(weights, shape)| {
            let dims = [shape.outputs, shape.inputs, shape.kernel, shape.kernel];
            Stage {
                weight: Tensor::from_data(TensorData::new(weights.weight, dims), device),
                bias: Tensor::from_data(TensorData::new(weights.bias, [shape.outputs]), device),
                head: Tensor::from_data(TensorData::new(weights.head, [1, shape.outputs, 1, 1]), device),
            }
        });
        let channels = |values: [f32; 3]| Tensor::from_data(TensorData::new(values.to_vec(), [1, 3, 1, 1]), device);
        Self {
            stages: stages.collect(),
            shift: channels(SHIFT),
            scale: channels(SCALE),
        }
    }

    /// Features of pictures `[b, 3, h, w]` in [0, 1]. Fails below [`MINIMUM_SIZE`].
    pub fn features(&self, pictures: Tensor<4>) -> Result<Features> {
        let [_, channels, h, w] = pictures.dims();
        if channels != 3 || h < MINIMUM_SIZE || w < MINIMUM_SIZE {
            return Err(Error::BadOption {
                field: "pictures",
                reason: format!("LPIPS needs RGB of at least {MINIMUM_SIZE} x {MINIMUM_SIZE} pixels, not {w} x {h}"),
            });
        }
        let mut x = (pictures * 2.0 - 1.0 - self.shift.clone()) / self.scale.clone();
        let mut features = Vec::with_capacity(self.stages.len());
        for (i, (stage, shape)) in self.stages.iter().zip(CONVOLUTIONS).enumerate() {
            if i == 1 || i == 2 {
                x = max_pool2d(x, MaxPoolOptions::new([3, 3]).with_stride([2, 2]));
            }
            let options = ConvOptions::new([shape.stride; 2], [shape.padding; 2], [1, 1], 1);
            x = relu(conv2d(x, stage.weight.clone(), Some(stage.bias.clone()), options));
            // The root's argument is kept off zero, where its slope is infinite.
            let norm = (x.clone().square().sum_dim(1) + EPSILON * EPSILON).sqrt() + EPSILON;
            features.push(x.clone() / norm);
        }
        Ok(Features(features))
    }

    /// Distance of each pair of views, `[b]`, 0 for identical ones; both must stem from this network and from batches
    /// of one shape.
    pub fn distance(&self, a: &Features, b: &Features) -> Tensor<1> {
        let layers = self.stages.iter().zip(a.0.iter().zip(&b.0)).map(|(stage, (a, b))| {
            let [batch, channels, h, w] = a.dims();
            let weighted = (a.clone() - b.clone()).square() * stage.head.clone();
            // Sum over channels, mean over positions.
            weighted.reshape([batch, channels * h * w]).sum_dim(1).reshape([batch]) / (h * w) as f32
        });
        let [batch, ..] = a.0[0].dims();
        let zero = Tensor::zeros([batch], &a.0[0].device());
        layers.fold(zero, |sum, layer| sum + layer)
    }

    /// Distance of each view, `[b]`, of pictures `[b, 3, h, w]` in [0, 1]; differentiable in both.
    pub fn per_view(&self, original: Tensor<4>, marked: Tensor<4>) -> Result<Tensor<1>> {
        Ok(self.distance(&self.features(original)?, &self.features(marked)?))
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::testing::model_path;

    fn weights() -> Option<Lpips> {
        let path = model_path("lpips_alex_v0.1.safetensors")?;
        Some(Lpips::load(&path, &Device::flex()).unwrap())
    }

    /// A smooth pattern that any language computes alike, `[1, 3, h, w]`.
    fn pattern(h: usize, w: usize, phase: f64, device: &Device) -> Tensor<4> {
        let value = |c: usize, y: usize, x: usize| {
            let (c, y, x) = (c as f64, y as f64, x as f64);
            (0.5 + 0.3 * (0.3 * x + c + phase).sin() + 0.2 * (0.23 * y - 0.5 * c + 2.0 * phase).cos()) as f32
        };
        let values: Vec<f32> = (0..3 * h * w).map(|i| value(i / (h * w), i / w % h, i % w)).collect();
        Tensor::from_data(TensorData::new(values, [1, 3, h, w]), device)
    }

    fn noise(x: &Tensor<4>, amount: f32) -> Tensor<4> {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let dims = x.dims();
        let values: Vec<f32> = (0..dims.iter().product())
            .map(|_| amount * (rng.random::<f32>() - 0.5))
            .collect();
        x.clone() + Tensor::from_data(TensorData::new(values, dims), &x.device())
    }

    fn scalar(x: Tensor<1>) -> f32 {
        x.into_scalar::<f32>()
    }

    #[test]
    fn zero_for_identical_symmetric_and_growing_with_noise() {
        let Some(lpips) = weights() else { return };
        let device = Device::flex();
        let x = pattern(64, 48, 0.0, &device);
        assert_eq!(scalar(lpips.per_view(x.clone(), x.clone()).unwrap()), 0.0);
        let y = noise(&x, 0.3);
        let there = scalar(lpips.per_view(x.clone(), y.clone()).unwrap());
        let back = scalar(lpips.per_view(y, x.clone()).unwrap());
        assert!((there - back).abs() < 1e-7);
        let growing: Vec<f32> = [0.05, 0.1, 0.3, 0.8]
            .iter()
            .map(|&n| scalar(lpips.per_view(x.clone(), noise(&x, n)).unwrap()))
            .collect();
        assert!(
            growing[0] > 0.0 && growing.windows(2).all(|w| w[0] < w[1]),
            "{growing:?}"
        );
    }

    #[test]
    fn agrees_with_pytorch() {
        let Some(lpips) = weights() else { return };
        let device = Device::flex();
        for (h, w, expected) in PYTORCH {
            let value = scalar(
                lpips
                    .per_view(pattern(h, w, 0.0, &device), pattern(h, w, 0.7, &device))
                    .unwrap(),
            );
            assert!((value - expected).abs() < 1e-5, "{h} x {w}: {value} {expected}");
        }
    }

    #[test]
    fn gradient_agrees_with_pytorch_and_is_finite_on_black() {
        let Some(lpips) = weights() else { return };
        let device = Device::flex().autodiff();
        let (x, y) = (
            pattern(40, 35, 0.0, &device),
            pattern(40, 35, 0.7, &device).require_grad(),
        );
        let gradients = lpips.per_view(x.clone(), y.clone()).unwrap().backward();
        let gradient = y.grad(&gradients).unwrap().try_into_vec_as::<f32>().unwrap();
        // PyTorch's, because the network has so many kinks that differences mislead by percents.
        let norm = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
        assert!((norm - 0.018_454_146).abs() < 1e-6, "{norm}");
        for (at, expected) in [
            (0, 2.090_119e-5),
            (700, -4.275_439e-5),
            (2100, -4.159_19e-4),
            (3333, 1.460_874e-4),
        ] {
            assert!(
                (gradient[at] - expected).abs() < 1e-7,
                "{at}: {} {expected}",
                gradient[at]
            );
        }

        let black = Tensor::<4>::zeros([1, 3, 40, 35], &device).require_grad();
        let gradients = lpips.per_view(x, black.clone()).unwrap().backward();
        let gradient = black.grad(&gradients).unwrap().try_into_vec_as::<f32>().unwrap();
        assert!(gradient.iter().all(|v| v.is_finite()));
    }

    #[test]
    fn views_are_independent_and_small_ones_refused() {
        let Some(lpips) = weights() else { return };
        let device = Device::flex();
        let (x, y) = (pattern(32, 32, 0.0, &device), pattern(32, 32, 0.7, &device));
        let pair = |a: &Tensor<4>, b: &Tensor<4>| Tensor::cat(vec![a.clone(), b.clone()], 0);
        let both = lpips
            .per_view(pair(&x, &x), pair(&x, &y))
            .unwrap()
            .try_into_vec_as::<f32>()
            .unwrap();
        assert_eq!(both[0], 0.0);
        assert!((both[1] - scalar(lpips.per_view(x, y).unwrap())).abs() < 1e-6);
        lpips.features(pattern(31, 31, 0.0, &device)).unwrap();
        let Err(error) = lpips.features(pattern(31, 30, 0.0, &device)) else {
            panic!()
        };
        assert!(error.to_string().contains("at least 31 x 31 pixels, not 30 x 31"));
    }

    /// Height, width and the distance that PyTorch's functional operations give for the same weights and pattern.
    const PYTORCH: [(usize, usize, f32); 2] = [(64, 64, 0.052_394_65), (53, 90, 0.049_663_275)];
}
