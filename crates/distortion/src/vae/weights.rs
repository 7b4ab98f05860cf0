//! Loads the weights of the learned codec from safetensors, bounded and checked.
use std::fs::File;
use std::io::Read;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors};

use crate::error::{Error, Result};

/// The published weights have 12 MB; anything much larger is something else.
const MAX_BYTES: u64 = 64 << 20;

/// Largest header that is read; a longer one takes a multiple of its length while it is parsed.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Side of all convolution kernels.
const KERNEL: usize = 5;

/// Stages of each transform.
const STAGES: usize = 4;

/// CompressAI's `NonNegativeParametrizer` stores `sqrt(x + pedestal)`.
const PEDESTAL: f64 = 1.0 / (1_u64 << 36) as f64;

/// Smallest beta of a normalisation.
const SMALLEST_BETA: f64 = 1e-6;

/// Channels of the hidden stages and of the latents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channels {
    pub hidden: usize,
    pub latents: usize,
}

impl Channels {
    /// Those of qualities 1 to 5.
    pub const PUBLISHED: Self = Self {
        hidden: 128,
        latents: 192,
    };
}

/// One convolution, with beta and gamma of what follows it.
pub(super) struct Stage {
    pub weight: Vec<f32>,
    pub shape: [usize; 4],
    pub bias: Vec<f32>,
    pub outputs: usize,
    pub gdn: Option<(Vec<f32>, Vec<f32>)>,
}

/// All that the transforms need.
pub(super) struct Weights {
    pub analysis: Vec<Stage>,
    pub synthesis: Vec<Stage>,
    pub medians: Vec<f32>,
}

/// The file's bytes, if there are not too many.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    let io = |source| Error::Io {
        path: path.into(),
        source,
    };
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(io)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// The weights from a file's bytes.
pub(super) fn parse(bytes: &[u8], channels: Channels) -> Result<Weights, String> {
    if bytes.len() as u64 > MAX_BYTES {
        return Err(format!("it is larger than {MAX_BYTES} bytes"));
    }
    let header = bytes.first_chunk().map_or(0, |word| u64::from_le_bytes(*word));
    if header > MAX_HEADER_BYTES {
        return Err(format!(
            "its header promises {header} bytes, at most {MAX_HEADER_BYTES} are read"
        ));
    }
    let file = SafeTensors::deserialize(bytes).map_err(|e| format!("not a safetensors file ({e})"))?;
    let Channels { hidden, latents } = channels;
    let quantiles = tensor(&file, "entropy_bottleneck.quantiles", &[latents, 1, 3])?;
    Ok(Weights {
        analysis: transform(&file, "g_a", [3, hidden, hidden, hidden, latents])?,
        synthesis: transform(&file, "g_s", [latents, hidden, hidden, hidden, 3])?,
        // Each channel has a low quantile, the median and a high one.
        medians: quantiles
            .as_chunks::<3>()
            .0
            .iter()
            .map(|[_, median, _]| *median)
            .collect(),
    })
}

/// The stages of `g_a` or `g_s`, from `channels[0]` over those between to `channels[4]`.
fn transform(file: &SafeTensors, name: &str, channels: [usize; STAGES + 1]) -> Result<Vec<Stage>, String> {
    let stage = |(i, pair): (usize, &[usize; 2])| {
        let [inputs, outputs] = *pair;
        // Transposed convolutions have their inputs first.
        let [first, second] = if name == "g_s" {
            [inputs, outputs]
        } else {
            [outputs, inputs]
        };
        let shape = [first, second, KERNEL, KERNEL];
        // Convolutions and normalisations alternate, but for the last.
        let (conv, norm) = (format!("{name}.{}", 2 * i), format!("{name}.{}", 2 * i + 1));
        let gdn = (i + 1 < STAGES).then(|| {
            let beta = tensor(file, &format!("{norm}.beta"), &[outputs])?;
            let gamma = tensor(file, &format!("{norm}.gamma"), &[outputs, outputs])?;
            Ok::<_, String>((not_negative(&beta, SMALLEST_BETA), not_negative(&gamma, 0.0)))
        });
        Ok(Stage {
            weight: tensor(file, &format!("{conv}.weight"), &shape)?,
            shape,
            bias: tensor(file, &format!("{conv}.bias"), &[outputs])?,
            outputs,
            gdn: gdn.transpose()?,
        })
    };
    channels.array_windows::<2>().enumerate().map(stage).collect()
}

/// The numbers that CompressAI's reparametrisation stands for: `max(stored, sqrt(minimum + pedestal))^2 - pedestal`.
pub(super) fn not_negative(stored: &[f32], minimum: f64) -> Vec<f32> {
    let bound = (minimum + PEDESTAL).sqrt();
    let value = |s: &f32| {
        let s = f64::from(*s).max(bound);
        (s * s - PEDESTAL) as f32
    };
    stored.iter().map(value).collect()
}

/// The values of one tensor, which must have this shape.
fn tensor(file: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
    let view = file.tensor(name).map_err(|_| format!("tensor {name} is missing"))?;
    if view.shape() != shape {
        return Err(format!("tensor {name} has shape {:?}, must be {shape:?}", view.shape()));
    }
    if view.dtype() != Dtype::F32 {
        return Err(format!("tensor {name} is {:?}, must be F32", view.dtype()));
    }
    let words = view.data().as_chunks::<4>().0;
    let values: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
    match values.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(format!("tensor {name} is not finite at element {i}")),
        None => Ok(values),
    }
}
