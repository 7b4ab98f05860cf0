//! Weights of the decoder as plain data, with fixed shapes but for the number of bits.
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::error::{Error, Result, within};
use crate::parameter::draw;

/// Most bits that a decoder reads.
pub const MAX_BITS: usize = 128;
/// Channels before the first block and after each one.
pub(crate) const CHANNELS: [usize; BLOCKS + 1] = [3, 32, 64, 64, 96];
/// By how much each block shrinks the sides.
pub(crate) const STRIDES: [usize; BLOCKS] = [2, 2, 1, 2];
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

/// Weights of a decoder for some number of bits, and the seed they were trained with.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    pub(crate) bits: usize,
    pub(crate) seed: u64,
    pub(crate) blocks: [Block; BLOCKS],
    /// `[FEATURES, bits]`, row-major.
    pub(crate) head: Vec<f32>,
    /// `[bits]`.
    pub(crate) bias: Vec<f32>,
}

/// One tensor: its name in a file, its shape and its values.
pub(crate) struct Named<T> {
    pub name: String,
    pub shape: Vec<usize>,
    pub values: T,
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
            seed,
            blocks,
            head: draw(&mut rng, FEATURES * bits, 1.0 / (FEATURES as f32).sqrt()),
            bias: vec![0.0; bits],
        })
    }

    /// Bits that it reads.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// The seed of the training.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// All tensors, in the order of the file and of the id.
    pub(crate) fn tensors(&self) -> Vec<Named<&Vec<f32>>> {
        let blocks = self.blocks.iter();
        let values = blocks.flat_map(|block| [&block.kernel, &block.gain, &block.shift]);
        let values = values.chain([&self.head, &self.bias]);
        let shapes = shapes(self.bits).into_iter().zip(values);
        shapes
            .map(|((name, shape), values)| Named { name, shape, values })
            .collect()
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
            return Err(Error::BadWeights {
                name: name.into(),
                reason,
            });
        }
        Ok(())
    }
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
