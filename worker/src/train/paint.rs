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
pub(super) const MEANING: usize = 96;
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
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0070_6169_6e74);
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

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn captions_change_the_object_alone_and_by_their_strength() {
        let device = Device::flex();
        let compute = Compute {
            device: device.clone(),
            name: "cpu".into(),
            is_gpu: false,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let painter = Painter::new(normals(5 * MEANING, &mut rng), MEANING, 1, &compute);
        let (size, half) = (IMAGE_SIZE, IMAGE_SIZE * IMAGE_SIZE / 2);
        let grain: Vec<f32> = (0..3 * size * size)
            .map(|_| 0.5 + 0.05 * rng.random_range(-1.0..1.0_f32))
            .collect();
        let view = Tensor::<4>::from_data(TensorData::new(grain.clone(), [1, 3, size, size]), &device);
        let mask: Vec<f32> = (0..size * size).map(|p| f32::from(u8::from(p < half))).collect();
        let mask = Tensor::<4>::from_data(TensorData::new(mask, [1, 1, size, size]), &device);
        let painted = |words: Vec<i64>| {
            painter
                .paint(view.clone(), mask.clone(), &[words], 0.05)
                .try_to_vec_as::<f32>()
                .unwrap()
        };
        let (first, other) = (painted(vec![1, 2]), painted(vec![3, 4]));
        assert_eq!(first, painted(vec![2, 1])); // a sum of words
        assert_ne!(first, other);
        let mut energy = 0.0;
        for (i, (a, b)) in first.iter().zip(&grain).enumerate() {
            if i % (size * size) < half {
                energy += (a - b).powi(2);
            } else {
                assert_eq!(a, b);
            }
        }
        let rms = (energy / (3 * half) as f32).sqrt();
        assert!((0.03..0.051).contains(&rms), "{rms}"); // a little less than asked for: the largest changes are cut
    }
}
