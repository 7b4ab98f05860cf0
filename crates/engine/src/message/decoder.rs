//! The message decoder, from projected CLIP features to one logit a bit: a perceptron or a linear map; and its loss.
use burn::module::{Module, Param, ParamId};
use burn::nn::Linear;
use burn::tensor::activation::{gelu, softplus};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha20Rng;

use crate::card;
use crate::error::{Error, Result};

/// Width of the two hidden layers.
pub const HIDDEN: usize = 256;

/// Weights of one linear layer, `y = x W + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerWeights {
    /// Input width.
    pub inputs: usize,
    /// Output width.
    pub outputs: usize,
    /// W, `inputs` x `outputs`, row-major.
    pub weight: Vec<f32>,
    /// b, `outputs` numbers.
    pub bias: Vec<f32>,
}

/// Weights of a decoder as plain data: what a key file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct DecoderWeights {
    /// The layers in order, each one's outputs the next one's inputs: three, or one of a linear decoder.
    pub layers: Vec<LayerWeights>,
}

impl DecoderWeights {
    /// Untrained weights for `inputs` features and `bits` logits: uniform in +-1/sqrt(fan-in), as PyTorch's `Linear`.
    pub fn seeded(inputs: usize, bits: usize, seed: u64) -> Self {
        let mut rng = ChaCha20Rng::seed_from_u64(seed);
        let mut layer = |inputs: usize, outputs: usize| {
            let bound = 1.0 / (inputs as f32).sqrt();
            let mut draw = || (unit(&mut rng) * 2.0 - 1.0) * bound;
            LayerWeights {
                inputs,
                outputs,
                weight: (0..inputs * outputs).map(|_| draw()).collect(),
                bias: (0..outputs).map(|_| draw()).collect(),
            }
        };
        Self {
            layers: vec![layer(inputs, HIDDEN), layer(HIDDEN, HIDDEN), layer(HIDDEN, bits)],
        }
    }

    /// Width of the features it reads.
    pub fn inputs(&self) -> usize {
        self.layers.first().map_or(0, |layer| layer.inputs)
    }

    /// Bits it reads.
    pub fn bits(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.outputs)
    }

    /// Checks that sizes fit together and that every number is finite.
    pub fn check(&self) -> Result<(), String> {
        for (i, layer) in self.layers.iter().enumerate() {
            if layer.weight.len() != layer.inputs * layer.outputs || layer.bias.len() != layer.outputs {
                return Err(format!("decoder layer {i} is not {} x {}", layer.inputs, layer.outputs));
            }
            if i > 0 && self.layers[i - 1].outputs != layer.inputs {
                return Err(format!("decoder layer {i} does not fit the layer before it"));
            }
            if let Some(v) = layer.weight.iter().chain(&layer.bias).find(|v| !v.is_finite()) {
                return Err(format!("decoder layer {i} holds {v}"));
            }
        }
        Ok(())
    }
}

/// Uniform in [0, 1), from 24 bits; our own so that seeds mean the same with every release of `rand`.
pub(super) fn unit(rng: &mut impl Rng) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1_u32 << 24) as f32
}

/// The decoder on a device. GELU (exact) between the layers, none after the last.
#[derive(Module, Debug)]
pub struct Decoder {
    layers: Vec<Linear>,
}

impl Decoder {
    /// Puts weights on a device; with an autodiff device they can be trained.
    pub fn new(weights: &DecoderWeights, device: &Device) -> Self {
        Self {
            layers: weights.layers.iter().map(|layer| to_linear(layer, device)).collect(),
        }
    }

    /// Copies the weights back to the host.
    pub fn weights(&self) -> Result<DecoderWeights> {
        Ok(DecoderWeights {
            layers: self.layers.iter().map(from_linear).collect::<Result<_>>()?,
        })
    }

    /// Logits `[b, bits]` of projected features `[b, inputs]`.
    pub fn forward(&self, features: Tensor<2>) -> Tensor<2> {
        let mut x = features;
        for (i, layer) in self.layers.iter().enumerate() {
            x = card::layer(layer, if i == 0 { x } else { hidden(x) });
        }
        x
    }
}

/// What hidden layers are passed through.
fn hidden(x: Tensor<2>) -> Tensor<2> {
    match card::on_card(&x) {
        true => card::gelu(x, false),
        false => gelu(x),
    }
}

fn to_linear(layer: &LayerWeights, device: &Device) -> Linear {
    let weight = TensorData::new(layer.weight.clone(), [layer.inputs, layer.outputs]);
    let bias = TensorData::new(layer.bias.clone(), [layer.outputs]);
    Linear {
        weight: Param::initialized(ParamId::new(), trainable(Tensor::from_data(weight, device))),
        bias: Some(Param::initialized(
            ParamId::new(),
            trainable(Tensor::from_data(bias, device)),
        )),
    }
}

/// Tracks gradients where the device does.
fn trainable<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    if tensor.is_autodiff() {
        tensor.require_grad()
    } else {
        tensor
    }
}

fn from_linear(linear: &Linear) -> Result<LayerWeights> {
    let read = |e: burn::tensor::TensorReadError| Error::Device {
        device: "decoder".into(),
        reason: e.to_string(),
    };
    let [inputs, outputs] = linear.weight.dims();
    let weight = linear.weight.val().try_to_vec_as::<f32>().map_err(read)?;
    let bias = match &linear.bias {
        Some(bias) => bias.val().try_to_vec_as::<f32>().map_err(read)?,
        None => vec![0.0; outputs],
    };
    Ok(LayerWeights {
        inputs,
        outputs,
        weight,
        bias,
    })
}

/// Mean binary cross entropy of logits `[b, bits]` against targets of exactly 0 or 1, of the same shape or `[1, bits]`; one
/// number.
///
/// For such targets -log of the target's probability is softplus of the logit, its sign turned where the target is 1.
/// That form neither overflows nor cancels, and its gradient is right at 0 too.
pub fn bce_from_logits(logits: Tensor<2>, targets: Tensor<2>) -> Tensor<1> {
    let sign = targets.mul_scalar(-2.0).add_scalar(1.0);
    softplus(logits * sign, 1.0).mean()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(values: &[f32], device: &Device) -> Tensor<2> {
        Tensor::from_data(TensorData::new(values.to_vec(), [1, values.len()]), device)
    }

    fn loss_and_gradient(logit: f32, target: f32) -> (f32, f32) {
        let device = Device::flex().autodiff();
        let logits = tensor(&[logit], &device).require_grad();
        let loss = bce_from_logits(logits.clone(), tensor(&[target], &device));
        let gradient = logits.grad(&loss.backward()).unwrap();
        (loss.into_scalar::<f32>(), gradient.into_scalar::<f32>())
    }

    #[test]
    fn cross_entropy_is_stable_and_its_gradient_right() {
        for x in [-1e4_f32, -88.0, -20.5, -3.0, -1e-3, 0.0, 0.7, 15.0, 20.5, 100.0, 1e4] {
            for y in [0.0, 1.0] {
                let (loss, gradient) = loss_and_gradient(x, y);
                let z = f64::from(x);
                let expected = z.max(0.0) - z * f64::from(y) + (-z.abs()).exp().ln_1p();
                let slope = 1.0 / (1.0 + (-z).exp()) - f64::from(y);
                assert!(
                    (f64::from(loss) - expected).abs() <= 1e-6 * (1.0 + expected),
                    "{x} {y}: {loss}"
                );
                assert!((f64::from(gradient) - slope).abs() <= 1e-6, "{x} {y}: {gradient}");
            }
        }
    }

    #[test]
    fn weights_survive_the_device_and_the_seed_decides() {
        let weights = DecoderWeights::seeded(20, 7, 1);
        weights.check().unwrap();
        assert_eq!((weights.inputs(), weights.bits()), (20, 7));
        assert_eq!(Decoder::new(&weights, &Device::flex()).weights().unwrap(), weights);
        assert_eq!(DecoderWeights::seeded(20, 7, 1), weights);
        assert_ne!(DecoderWeights::seeded(20, 7, 2), weights);
    }

    #[test]
    fn forward_agrees_with_a_plain_computation() {
        let weights = DecoderWeights::seeded(5, 3, 9);
        let x = [0.5, -1.0, 2.0, 0.0, 1.5];
        let erf = |x: f64| {
            // Series, enough terms for |x| < 3.
            let mut term = x;
            let mut sum = x;
            for n in 1..60 {
                term *= -x * x / f64::from(n);
                sum += term / f64::from(2 * n + 1);
            }
            sum * 2.0 / std::f64::consts::PI.sqrt()
        };
        let mut values: Vec<f64> = x.iter().map(|&v| f64::from(v)).collect();
        for (i, layer) in weights.layers.iter().enumerate() {
            values = (0..layer.outputs)
                .map(|o| {
                    let weighted = values.iter().enumerate();
                    let sum: f64 = weighted
                        .map(|(r, v)| v * f64::from(layer.weight[r * layer.outputs + o]))
                        .sum();
                    let y = sum + f64::from(layer.bias[o]);
                    if i < 2 {
                        0.5 * y * (1.0 + erf(y / 2_f64.sqrt()))
                    } else {
                        y
                    }
                })
                .collect();
        }
        let device = Device::flex();
        let logits = Decoder::new(&weights, &device)
            .forward(tensor(&x, &device))
            .try_to_vec_as::<f32>()
            .unwrap();
        for (logit, expected) in logits.iter().zip(values) {
            assert!((f64::from(*logit) - expected).abs() < 1e-5, "{logit} {expected}");
        }
    }

    #[test]
    fn a_zero_feature_gives_finite_logits() {
        let device = Device::flex();
        let decoder = Decoder::new(&DecoderWeights::seeded(8, 4, 3), &device);
        let logits = decoder
            .forward(Tensor::zeros([2, 8], &device))
            .try_to_vec_as::<f32>()
            .unwrap();
        assert!(logits.iter().all(|v| v.is_finite()));
    }

    #[test]
    fn damage_is_named() {
        let mut weights = DecoderWeights::seeded(8, 4, 3);
        weights.layers[1].bias[0] = f32::INFINITY;
        assert!(weights.check().unwrap_err().contains("layer 1 holds inf"));
        weights.layers[0].outputs = 5;
        assert!(weights.check().unwrap_err().contains("layer 0 is not 8 x 5"));
    }
}
