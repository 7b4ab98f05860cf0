//! Weights of the decoder as plain data, with fixed shapes but for the number of bits.
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::error::{Error, Result, within};
use crate::parameter::draw;

/// Most bits that a decoder reads.
pub const MAX_BITS: usize = 128;
/// Channels before the first block and after each one.
pub(crate) const CHANNELS: [usize; BLOCKS + 1] = [3, 16, 32, 32, 48];
/// By how much each block shrinks the sides. More than once would tell decoders where a pattern's pixels lie on the strides,
/// which they then learn, and read nothing that was moved by less.
pub(crate) const STRIDES: [usize; BLOCKS] = [2, 1, 1, 1];
/// How far apart the pixels are that each block's kernels see.
pub(crate) const DILATIONS: [usize; BLOCKS] = [1, 1, 2, 2];
/// Blocks of convolution, normalisation and ReLU.
pub(crate) const BLOCKS: usize = 4;
/// Sides of the convolutions' kernels.
pub(crate) const KERNEL: usize = 3;
/// Channels that the head sees.
pub(crate) const FEATURES: usize = CHANNELS[BLOCKS];

/// Weights of one block.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Block {
    /// Kernel `[outputs, inputs, 3, 3]`, row-major.
    pub kernel: Vec<f32>,
    /// What the normalised channels are multiplied by, `[outputs]`.
    pub gain: Vec<f32>,
    /// What is added to them then, `[outputs]`.
    pub shift: Vec<f32>,
}

/// Weights of a decoder for some number of bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    pub(crate) bits: usize,
    pub(crate) blocks: [Block; BLOCKS],
    /// `[FEATURES, bits]`, row-major.
    pub(crate) head: Vec<f32>,
    /// `[bits]`.
    pub(crate) bias: Vec<f32>,
}

/// One tensor: its name in a file, its shape and its values, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Named<'a> {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// As many values as the shape says.
    pub values: &'a [f32],
}

impl Weights {
    /// Untrained weights: kernels uniform with variance 2 / fan-in (He et al. 2015, arXiv 1502.01852), the head uniform
    /// in +-1 / sqrt(fan-in).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless there are 1 to [`MAX_BITS`] bits.
    pub fn seeded(bits: usize, seed: u64) -> Result<Self> {
        within("bits", bits as f64, 1.0, MAX_BITS as f64)?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let blocks = std::array::from_fn(|i| {
            let (inputs, outputs) = (CHANNELS[i], CHANNELS[i + 1]);
            let fan_in = inputs * KERNEL * KERNEL;
            Block {
                kernel: draw(&mut rng, outputs * fan_in, (6.0 / fan_in as f32).sqrt()),
                gain: vec![1.0; outputs],
                shift: vec![0.0; outputs],
            }
        });
        Ok(Self {
            bits,
            blocks,
            head: draw(&mut rng, FEATURES * bits, 1.0 / (FEATURES as f32).sqrt()),
            bias: vec![0.0; bits],
        })
    }

    /// Bits that it reads.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// All tensors, in the order of a file and of an id.
    pub fn tensors(&self) -> Vec<Named<'_>> {
        let blocks = self.blocks.iter();
        let values = blocks.flat_map(|block| [&block.kernel, &block.gain, &block.shift]);
        let values = values.chain([&self.head, &self.bias]);
        let shapes = shapes(self.bits).into_iter().zip(values);
        shapes
            .map(|((name, shape), values)| Named { name, shape, values })
            .collect()
    }

    /// Weights whose tensors are those that `read` gives for a name and a shape.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for other numbers of bits than [`Weights::seeded`] has, what `read` says, and
    /// [`Error::BadWeights`] for tensors of another length or with values that are not finite; `name` is for messages.
    pub fn from_tensors(
        name: &str,
        bits: usize,
        mut read: impl FnMut(&str, &[usize]) -> Result<Vec<f32>, String>,
    ) -> Result<Self> {
        within("bits", bits as f64, 1.0, MAX_BITS as f64)?;
        let tensors = shapes(bits).into_iter().map(|(tensor, shape)| read(&tensor, &shape));
        let tensors = tensors.collect::<Result<Vec<_>, _>>();
        let mut tensors = tensors.map_err(|reason| bad(name, reason))?.into_iter();
        let mut take = || tensors.next().unwrap_or_default();
        let blocks = std::array::from_fn(|_| Block {
            kernel: take(),
            gain: take(),
            shift: take(),
        });
        let (head, bias) = (take(), take());
        let weights = Self {
            bits,
            blocks,
            head,
            bias,
        };
        weights.check(name)?;
        Ok(weights)
    }

    /// Fails with [`Error::BadWeights`] unless every tensor has as many numbers as its shape says, all of them finite.
    pub(crate) fn check(&self, name: &str) -> Result<()> {
        for tensor in self.tensors() {
            let count: usize = tensor.shape.iter().product();
            let wrong = tensor.values.iter().find(|v| !v.is_finite());
            let reason = match wrong {
                Some(value) => format!("{} holds {value}", tensor.name),
                None if tensor.values.len() != count => format!("{} is not {:?}", tensor.name, tensor.shape),
                None => continue,
            };
            return Err(bad(name, reason));
        }
        Ok(())
    }
}

fn bad(name: &str, reason: String) -> Error {
    let name = name.into();
    Error::BadWeights { name, reason }
}

/// Names and shapes of the tensors of a decoder of `bits` bits, in order.
pub(crate) fn shapes(bits: usize) -> Vec<(String, Vec<usize>)> {
    let mut all = Vec::new();
    for (i, pair) in CHANNELS.windows(2).enumerate() {
        let &[inputs, outputs] = pair else { continue };
        all.push((format!("block.{i}.kernel"), vec![outputs, inputs, KERNEL, KERNEL]));
        all.push((format!("block.{i}.gain"), vec![outputs]));
        all.push((format!("block.{i}.shift"), vec![outputs]));
    }
    all.push(("head.weight".into(), vec![FEATURES, bits]));
    all.push(("head.bias".into(), vec![bits]));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_go_out_and_come_back() {
        let weights = Weights::seeded(5, 7).unwrap();
        let tensors = weights.tensors();
        let back = Weights::from_tensors("w", 5, |name, shape| {
            let found = tensors.iter().find(|t| t.name == name && t.shape == shape);
            found.map(|t| t.values.to_vec()).ok_or(format!("{name} is missing"))
        });
        assert_eq!(back.unwrap(), weights);
        assert_ne!(Weights::seeded(5, 8).unwrap(), weights);
        let reason = |bits, value: f32, length: usize| {
            let read = |_: &str, shape: &[usize]| Ok(vec![value; shape.iter().product::<usize>() + length]);
            Weights::from_tensors("w", bits, read).unwrap_err().to_string()
        };
        assert_eq!(reason(5, f32::INFINITY, 0), "w: block.0.kernel holds inf");
        assert!(reason(5, 0.0, 1).contains("block.0.kernel is not [16, 3, 3, 3]"));
        assert!(reason(0, 0.0, 0).contains("bits is 0"));
        let none = |_: &str, _: &[usize]| Err("nothing there".to_string());
        assert_eq!(
            Weights::from_tensors("w", 5, none).unwrap_err().to_string(),
            "w: nothing there"
        );
    }
}
