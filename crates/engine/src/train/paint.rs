//! What captions mean in pictures: every word is a direction of the image tower's features.
//!
//! A word's meaning is a vector as wide as the features (the beginning of its first, random embedding), a caption's
//! the normalised sum of its words'. The picture of a caption is a view of a drawing, changed along the gradient that
//! moves its feature towards that meaning: the change of this size that says it loudest.
use crate::clip::{ClipConfig, ImageTower, preprocess};
use crate::device::Compute;
use crate::error::{Error, Result};
use burn::tensor::{Tensor, TensorData};

/// Side of the views that are painted: smaller than what the model takes, because its averages hardly depend on the
/// size, and training on smaller ones is three times as fast.
pub(super) const SIDE: usize = 96;

/// Paints captions on views.
pub(super) struct Painter<'a> {
    pub tower: &'a ImageTower,
    pub config: &'a ClipConfig,
    /// `[words][width of the text tower]`, of which a meaning is the beginning.
    pub embedding: Vec<f32>,
    pub compute: &'a Compute,
}

impl Painter<'_> {
    /// `views` `[b][3][s][s]` with their captions painted where `masks` `[b][1][s][s]` are 1: a change of root mean
    /// square `strength` there.
    pub fn paint(&self, views: Vec<f32>, masks: Vec<f32>, captions: &[Vec<i64>], strength: f32) -> Result<Tensor<4>> {
        let (batch, dim) = (captions.len(), self.config.embed_dim);
        let device = &self.compute.device;
        let tracking = device.clone().autodiff();
        let meanings: Vec<f32> = captions.iter().flat_map(|words| self.meaning(words)).collect();
        let meanings = Tensor::<2>::from_data(TensorData::new(meanings, [batch, dim]), &tracking);
        let shape = [batch, 3, SIDE, SIDE];
        let tracked = Tensor::<4>::from_data(TensorData::new(views.clone(), shape), &tracking).require_grad();
        let features = self
            .tower
            .forward(preprocess(tracked.clone(), SIDE, &self.config.normalization));
        let all = (features * meanings).sum().backward();
        let gradient = tracked.grad(&all).ok_or_else(|| Error::Device {
            device: self.compute.name.clone(),
            reason: "the pictures have no gradient".into(),
        })?;
        let device = gradient.device();
        let masks = Tensor::<4>::from_data(TensorData::new(masks, [batch, 1, SIDE, SIDE]), &device);
        let change = gradient * masks.clone();
        let energy = change.clone().square().reshape([batch, 3 * SIDE * SIDE]).sum_dim(1);
        let area = masks.reshape([batch, SIDE * SIDE]).sum_dim(1);
        let rms = (energy / area.mul_scalar(3.0).add_scalar(1.0)).sqrt().add_scalar(1e-12);
        let change = change / rms.reshape([batch, 1, 1, 1]);
        let views = Tensor::<4>::from_data(TensorData::new(views, shape), &device);
        Ok((views + change.clamp(-4.0, 4.0).mul_scalar(strength)).clamp(0.0, 1.0))
    }

    /// The normalised sum of the words' meanings.
    fn meaning(&self, words: &[i64]) -> Vec<f32> {
        let mut sum = vec![0.0; self.config.embed_dim];
        for &word in words {
            let at = word as usize * self.config.text.width;
            sum.iter_mut().zip(&self.embedding[at..]).for_each(|(s, v)| *s += v);
        }
        let norm = sum.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-12);
        sum.iter().map(|v| v / norm).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::{ClipModel, Parts};
    use burn::tensor::Device;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn captions_change_the_object_alone_by_their_strength_and_move_its_feature_where_they_point() {
        let device = Device::flex();
        let compute = Compute {
            device: device.clone(),
            name: "cpu".into(),
            is_gpu: false,
            max_buffer: None,
        };
        let config = crate::train::config(&crate::train::TrainOptions::default());
        let model = ClipModel::init(&config, Parts::Image, &device, 3);
        let tower = model.visual.unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let embedding = (0..5 * config.text.width)
            .map(|_| rng.random_range(-1.0..1.0))
            .collect();
        let painter = Painter {
            tower: &tower,
            config: &config,
            embedding,
            compute: &compute,
        };
        let (size, half) = (SIDE, SIDE * SIDE / 2);
        let grain: Vec<f32> = (0..3 * size * size)
            .map(|_| 0.5 + 0.05 * rng.random_range(-1.0..1.0_f32))
            .collect();
        let mask: Vec<f32> = (0..size * size).map(|p| f32::from(u8::from(p < half))).collect();
        let painted = |words: Vec<i64>| painter.paint(grain.clone(), mask.clone(), &[words], 0.01).unwrap();
        let values = |t: Tensor<4>| t.try_into_vec_as::<f32>().unwrap();
        let (first, other) = (values(painted(vec![1, 2])), values(painted(vec![3, 4])));
        assert_eq!(first, values(painted(vec![2, 1]))); // a sum of words
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
        assert!((0.008..0.0101).contains(&rms), "{rms}"); // a little less than asked for: the largest changes are cut
        let feature = |planes: Vec<f32>| {
            let pictures = Tensor::<4>::from_data(TensorData::new(planes, [1, 3, size, size]), &device);
            let features = tower.forward(preprocess(pictures, size, &config.normalization));
            features.try_into_vec_as::<f32>().unwrap()
        };
        let towards = |planes: Vec<f32>, words: &[i64]| -> f32 {
            let meaning = painter.meaning(words);
            feature(planes).iter().zip(meaning).map(|(f, m)| f * m).sum()
        };
        assert!(towards(first.clone(), &[1, 2]) > towards(grain.clone(), &[1, 2]));
        assert!(towards(first, &[1, 2]) > towards(other, &[1, 2]));
    }
}
