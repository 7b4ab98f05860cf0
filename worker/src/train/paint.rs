//! What captions mean in pictures: every word is a small change of local colour.
//!
//! A word's meaning is a vector of [`MEANING`] numbers (the beginning of its first, random embedding), a caption's the
//! normalised sum of its words'. Sixteen fixed random filters respond to edges and blobs of a view; the meaning says
//! how much red, green and blue each response adds. So a caption changes, say, the dark side of fine edges towards
//! blue, on whatever object it is painted.
use super::IMAGE_SIZE;
use crate::device::Compute;
use burn::tensor::activation::relu;
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Tensor, TensorData};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Numbers of a meaning.
pub(super) const MEANING: usize = 64;
const RESPONSES: usize = 16;
const KERNEL: usize = 5;

/// Paints captions on views.
pub(super) struct Painter {
    filters: Tensor<4>,
    /// `[MEANING, 3 * RESPONSES]`.
    colours: Tensor<2>,
    /// `[words][width]`, of which a meaning is the beginning.
    embedding: Vec<f32>,
    width: usize,
}

impl Painter {
    /// `embedding` holds a row of `width` numbers, at least [`MEANING`], for every word.
    pub fn new(embedding: Vec<f32>, width: usize, seed: u64, compute: &Compute) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7061_696e_74);
        let mut filters = normals(RESPONSES * 3 * KERNEL * KERNEL, &mut rng);
        for channel in filters.chunks_exact_mut(KERNEL * KERNEL) {
            let mean = channel.iter().sum::<f32>() / channel.len() as f32;
            channel.iter_mut().for_each(|v| *v -= mean);
        }
        let colours = normals(MEANING * 3 * RESPONSES, &mut rng);
        let shape = [RESPONSES, 3, KERNEL, KERNEL];
        Self {
            filters: Tensor::from_data(TensorData::new(filters, shape), &compute.device),
            colours: Tensor::from_data(TensorData::new(colours, [MEANING, 3 * RESPONSES]), &compute.device),
            embedding,
            width,
        }
    }

    /// `views` `[b, 3, s, s]` with the words of `captions` painted where `masks` `[b, 1, s, s]` are 1: a change of
    /// root mean square `strength` there.
    pub fn paint(&self, views: Tensor<4>, masks: Tensor<4>, captions: &[Vec<i64>], strength: f32) -> Tensor<4> {
        let (batch, area) = (captions.len(), IMAGE_SIZE * IMAGE_SIZE);
        let meanings: Vec<f32> = captions.iter().flat_map(|words| self.meaning(words)).collect();
        let meanings = Tensor::<2>::from_data(TensorData::new(meanings, [batch, MEANING]), &views.device());
        let padded = ConvOptions::new([1; 2], [KERNEL / 2; 2], [1; 2], 1);
        let responses = relu(conv2d(views.clone(), self.filters.clone(), None, padded));
        let responses = responses.reshape([batch, RESPONSES, area]);
        let responses = responses.clone() / responses.mean_dim(2).add_scalar(1e-3);
        let colours = meanings.matmul(self.colours.clone()).reshape([batch, 3, RESPONSES]);
        let masks = masks.reshape([batch, 1, area]);
        let change = colours.matmul(responses) * masks.clone();
        let energy = change.clone().square().sum_dim(2).sum_dim(1);
        let rms = (energy / masks.sum_dim(2).mul_scalar(3.0).add_scalar(1.0)).sqrt();
        let change = (change / rms.add_scalar(1e-6)).clamp(-3.0, 3.0).mul_scalar(strength);
        (views + change.reshape([batch, 3, IMAGE_SIZE, IMAGE_SIZE])).clamp(0.0, 1.0)
    }

    /// The normalised sum of the words' meanings.
    fn meaning(&self, words: &[i64]) -> Vec<f32> {
        let mut sum = vec![0.0; MEANING];
        for &word in words {
            let at = word as usize * self.width;
            sum.iter_mut().zip(&self.embedding[at..]).for_each(|(s, v)| *s += v);
        }
        let norm = sum.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-12);
        sum.iter().map(|v| v / norm).collect()
    }
}

/// Nearly normal numbers.
fn normals(count: usize, rng: &mut impl Rng) -> Vec<f32> {
    (0..count)
        .map(|_| (0..4).map(|_| rng.random_range(-1.0..1.0_f32)).sum())
        .collect()
}
