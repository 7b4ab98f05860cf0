//! Layer normalisation on burn's CPU device.
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{Shape, TensorData};
use rayon::prelude::*;

use super::{FloatTensor, LayerNormalized, Normalization};

/// Numbers that one task takes at least.
const TASK: usize = 1 << 14;

impl LayerNormalized for Flex {
    fn layer_normalized(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let [out, _] = Self::normalize(x, gamma, beta, epsilon);
        out
    }
}

impl Normalization for Flex {
    fn normalize(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f32,
    ) -> [FloatTensor<Self>; 2] {
        let shape = x.shape();
        let [x, gamma, beta] = [x, gamma, beta].map(|t| t.to_contiguous());
        let (x, gamma, beta): (&[f32], &[f32], &[f32]) = (x.storage(), gamma.storage(), beta.storage());
        let width = gamma.len();
        let rows = x.len() / width;
        let (mut out, mut moments) = (vec![0.0; x.len()], vec![[0.0_f32; 2]; rows]);
        let tasks = out.par_chunks_mut(width).zip(x.par_chunks(width)).zip(&mut moments);
        tasks
            .with_min_len(TASK.div_ceil(width))
            .for_each(|((out, x), moments)| {
                let mean = x.iter().sum::<f32>() / width as f32;
                let squares: f32 = x.iter().map(|x| (x - mean) * (x - mean)).sum();
                let scale = (squares / width as f32 + epsilon).sqrt().recip();
                *moments = [mean, scale];
                let weights = gamma.iter().zip(beta);
                for ((out, x), (gamma, beta)) in out.iter_mut().zip(x).zip(weights) {
                    *out = (x - mean) * scale * gamma + beta;
                }
            });
        let moments = TensorData::new(moments.concat(), [rows, 2]);
        [
            FloatTensor::<Self>::from_data(TensorData::new(out, shape)),
            FloatTensor::<Self>::from_data(moments),
        ]
    }

    fn normalize_backward(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        moments: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let shape: Shape = x.shape();
        let [x, gamma, moments, gradient] = [x, gamma, moments, gradient].map(|t| t.to_contiguous());
        let (x, gamma): (&[f32], &[f32]) = (x.storage(), gamma.storage());
        let (moments, gradient): (&[f32], &[f32]) = (moments.storage(), gradient.storage());
        let width = gamma.len();
        let mut out = vec![0.0_f32; x.len()];
        let rows = x.par_chunks(width).zip(gradient.par_chunks(width));
        let tasks = out.par_chunks_mut(width).zip(rows).zip(moments.par_chunks(2));
        tasks
            .with_min_len(TASK.div_ceil(width))
            .for_each(|((out, (x, gradient)), moments)| {
                let [mean, scale] = [moments[0], moments[1]];
                let (mut level, mut along) = (0.0, 0.0);
                for ((x, gradient), gamma) in x.iter().zip(gradient).zip(gamma) {
                    level += gradient * gamma;
                    along += gradient * gamma * (x - mean) * scale;
                }
                let [level, along] = [level, along].map(|sum| sum / width as f32);
                for ((out, x), (gradient, gamma)) in out.iter_mut().zip(x).zip(gradient.iter().zip(gamma)) {
                    *out = scale * (gradient * gamma - level - (x - mean) * scale * along);
                }
            });
        FloatTensor::<Self>::from_data(TensorData::new(out, shape))
    }
}
