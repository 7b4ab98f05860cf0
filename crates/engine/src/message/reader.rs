//! Reads logits from CLIP features with a key's projection and decoder: what embedding and extraction share.
use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::decoder::{Decoder, DecoderWeights};
use super::projection::{AffineMap, Projection};

/// Projection and decoder on a device, frozen: gradients flow to the features only.
#[derive(Clone, Debug)]
pub struct Reader {
    image: AffineMap,
    text: AffineMap,
    decoder: Decoder,
}

impl Reader {
    /// Puts both parts on `device`; an autodiff device is taken without its gradient tracking.
    pub fn new(projection: &Projection, decoder: &DecoderWeights, device: &Device) -> Self {
        let device = device.clone().without_autodiff();
        Self {
            image: projection.image_map(&device),
            text: projection.text_map(&device),
            decoder: Decoder::new(decoder, &device),
        }
    }

    /// Numbers that it holds.
    pub fn parameters(&self) -> usize {
        self.image.parameters() + self.text.parameters() + self.decoder.num_params()
    }

    /// Logits `[b, bits]` of L2-normalised image features `[b, width]`.
    pub fn image_logits(&self, features: Tensor<2>) -> Tensor<2> {
        self.decoder.forward(self.image.apply(features))
    }

    /// Logits `[b, bits]` of L2-normalised text features `[b, width]`.
    pub fn text_logits(&self, features: Tensor<2>) -> Tensor<2> {
        self.decoder.forward(self.text.apply(features))
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;

    #[test]
    fn gradients_reach_the_features_through_frozen_weights() {
        let device = Device::flex().autodiff();
        let reader = Reader::new(&Projection::identity(6), &DecoderWeights::seeded(6, 3, 1), &device);
        let at = |x: &[f32]| Tensor::<2>::from_data(TensorData::new(x.to_vec(), [1, 6]), &device);
        let x = [0.3, -0.2, 0.5, 0.1, -0.4, 0.6];
        let features = at(&x).require_grad();
        let gradients = reader.image_logits(features.clone()).sum().backward();
        let gradient = features.grad(&gradients).unwrap().try_to_vec_as::<f32>().unwrap();
        for i in 0..6 {
            let sum_at = |step: f32| {
                let mut moved = x;
                moved[i] += step;
                reader.image_logits(at(&moved)).sum().into_scalar::<f32>()
            };
            let slope = (sum_at(1e-2) - sum_at(-1e-2)) / 2e-2;
            assert!((slope - gradient[i]).abs() < 1e-3, "{i}: {slope} {}", gradient[i]);
        }
    }

    #[test]
    fn towers_use_their_own_side_of_the_projection() {
        let device = Device::flex();
        let mut projection = Projection::identity(4);
        projection.mean_text = vec![1.0; 4];
        let reader = Reader::new(&projection, &DecoderWeights::seeded(4, 2, 1), &device);
        let zeros = || Tensor::<2>::zeros([1, 4], &device);
        let image = reader.image_logits(zeros()).try_to_vec_as::<f32>().unwrap();
        assert_eq!(reader.text_logits(zeros() + 1.0).try_to_vec_as::<f32>().unwrap(), image);
        assert_ne!(reader.text_logits(zeros()).try_to_vec_as::<f32>().unwrap(), image);
    }
}
