//! The trained decoder as it is used: frozen, and differentiable in the pictures.
use burn::tensor::{Device, Tensor};

use crate::decoder::Decoder;
use crate::error::{Error, Result};
use crate::weights::Weights;

/// Shortest side of a picture that is read.
pub const MIN_SIDE: usize = 32;
/// Longest side of a picture that is read.
pub const MAX_SIDE: usize = 8192;

/// A decoder whose weights do not change.
#[derive(Clone, Debug)]
pub struct Network {
    decoder: Decoder,
    bits: usize,
    device: Device,
}

impl Network {
    /// Puts weights on a device, whether it tracks gradients or not: the weights have none.
    ///
    /// # Errors
    /// [`Error::BadWeights`] for weights that do not fit together.
    pub fn new(weights: &Weights, device: &Device) -> Result<Self> {
        weights.check("weights")?;
        let device = device.clone().without_autodiff();
        Ok(Self {
            decoder: Decoder::new(weights, &device),
            bits: weights.bits,
            device,
        })
    }

    /// Bits that it reads.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// Where its weights are; pictures must be there, too.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Logits `[b, bits]` of pictures `[b, 3, h, w]` in [0, 1]: positive for 1, negative for 0. Differentiable in the
    /// pictures. Each picture is read for itself and at its own size; what it was trained to stand is a change of scale
    /// by its [`crate::Geometry`], so a mark should be embedded at about the size at which it will be read.
    ///
    /// # Errors
    /// [`Error::BadShape`] for other shapes than those, and sides outside [`MIN_SIDE`] and [`MAX_SIDE`].
    pub fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        let shape @ [b, channels, h, w] = pictures.dims();
        let sides = MIN_SIDE..=MAX_SIDE;
        if b == 0 || channels != 3 || !sides.contains(&h) || !sides.contains(&w) {
            let expected = "[b, 3, h, w] with sides of 32 to 8192";
            return Err(Error::BadShape { shape, expected });
        }
        Ok(self.decoder.forward(pictures))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::host;
    use crate::synthetic::Synthetic;

    fn network() -> Network {
        Network::new(&Weights::seeded(6, 3).unwrap(), &Device::flex()).unwrap()
    }

    fn pictures(count: usize, side: usize) -> Tensor<4> {
        Synthetic::new(side, 1).unwrap().next(count, &Device::flex())
    }

    fn distance(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn each_picture_is_read_for_itself() {
        let network = network();
        let three = pictures(3, 40);
        let together = host(network.logits(three.clone()).unwrap()).unwrap();
        for i in 0..3 {
            let alone = host(network.logits(three.clone().slice(i..i + 1)).unwrap()).unwrap();
            assert!(distance(&alone, &together[6 * i..6 * i + 6]) < 1e-4);
        }
        assert!(distance(&together[..6], &together[6..12]) > 1e-3);
    }

    #[test]
    fn any_size_is_read_and_other_shapes_are_refused() {
        let network = network();
        for [h, w] in [[32, 57], [96, 96], [101, 64]] {
            let values = host(
                network
                    .logits(Tensor::ones([2, 3, h, w], &Device::flex()) * 0.5)
                    .unwrap(),
            )
            .unwrap();
            assert!(values.len() == 12 && values.iter().all(|v| v.is_finite()));
        }
        for shape in [[0, 3, 64, 64], [1, 4, 64, 64], [1, 3, 31, 64], [1, 3, 64, 8193]] {
            let error = network.logits(Tensor::zeros(shape, &Device::flex())).unwrap_err();
            assert!(matches!(error, Error::BadShape { .. }), "{error}");
        }
    }

    #[test]
    fn the_gradient_agrees_with_central_differences() {
        let network = network();
        let x = pictures(1, 32);
        let tracked = x.clone().autodiff().require_grad();
        let gradients = network
            .logits(tracked.clone())
            .unwrap()
            .slice([0..1, 2..3])
            .sum()
            .backward();
        let gradient = tracked.grad(&gradients).unwrap();
        // Along the gradient itself: single pixels change the logit by less than its rounding.
        let length = host(gradient.clone().square().sum().sqrt()).unwrap()[0];
        let direction = gradient / length;
        let step = 1e-3;
        let logit = |part: f32| host(network.logits(x.clone() + direction.clone() * part).unwrap()).unwrap()[2];
        let slope = (logit(step) - logit(-step)) / (2.0 * step);
        assert!(length > 1e-3, "{length}");
        assert!((slope - length).abs() < 0.05 * length, "{slope} {length}");
    }
}
