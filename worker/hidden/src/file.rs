//! Weights as bytes: a safetensors file with the seed, the bits and the id in its metadata.
use std::collections::HashMap;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};
use crate::weights::{BLOCKS, Block, MAX_BITS, Weights, shapes};

/// What the metadata calls the format; the number is its version.
const FORMAT: &str = "guardsplat-hidden 1";
/// Largest file that is read; the weights for the most bits take half a mebibyte.
pub const MAX_BYTES: usize = 4 << 20;
/// Largest header that is parsed.
const MAX_HEADER: u64 = 16 << 10;

impl Weights {
    /// SHA-256 over all that a file holds (version, bits, seed, and every tensor's name, shape and values), as 64
    /// hexadecimal digits.
    pub fn id(&self) -> String {
        let mut hash = Sha256::new();
        hash.update(FORMAT);
        hash.update((self.bits as u64).to_le_bytes());
        hash.update(self.seed.to_le_bytes());
        for tensor in self.tensors() {
            hash.update((tensor.name.len() as u64).to_le_bytes());
            hash.update(&tensor.name);
            for side in tensor.shape {
                hash.update((side as u64).to_le_bytes());
            }
            tensor.values.iter().for_each(|v| hash.update(v.to_le_bytes()));
        }
        hex::encode(hash.finalize())
    }

    /// The bytes of a safetensors file; the same weights give the same bytes.
    ///
    /// # Errors
    /// [`Error::BadWeights`] when the weights cannot be written as safetensors.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let bad = |e: safetensors::SafeTensorError| bad("weights", e.to_string());
        let tensors = self.tensors().into_iter().map(|tensor| {
            let bytes: Vec<u8> = tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect();
            (tensor.name, tensor.shape, bytes)
        });
        let tensors: Vec<_> = tensors.collect();
        let views = tensors.iter().map(|(name, shape, bytes)| {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytes);
            view.map(|view| (name.as_str(), view))
        });
        let views = views.collect::<Result<Vec<_>, _>>().map_err(bad)?;
        // One entry, since the order of several would differ from run to run.
        let text = format!("{FORMAT} bits {} seed {} id {}", self.bits, self.seed, self.id());
        let metadata = HashMap::from([(KEY.to_string(), text)]);
        safetensors::tensor::serialize(views, Some(metadata)).map_err(bad)
    }

    /// Reads what [`Weights::to_bytes`] wrote; `name` is for error messages.
    ///
    /// # Errors
    /// [`Error::BadWeights`] for other files, more than [`MAX_BYTES`], tensors that are missing, of another type or
    /// shape or not finite, and content that does not match the id.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self> {
        parse(bytes)
            .map_err(|reason| bad(name, reason))
            .and_then(|(weights, id)| {
                weights.check(name)?;
                if weights.id() == id {
                    return Ok(weights);
                }
                let reason = format!("its content does not match its id {id}: the file is damaged");
                Err(bad(name, reason))
            })
    }
}

/// Where the metadata has its one entry.
const KEY: &str = "guardsplat_hidden";

fn bad(name: &str, reason: String) -> Error {
    let name = name.into();
    Error::BadWeights { name, reason }
}

/// Weights that are not checked yet, and the id that the file claims.
fn parse(bytes: &[u8]) -> Result<(Weights, String), String> {
    if bytes.len() > MAX_BYTES {
        return Err(format!("it is larger than {MAX_BYTES} bytes"));
    }
    let header = bytes.first_chunk().map(|length| u64::from_le_bytes(*length));
    match header {
        None => return Err("not a safetensors file, or a truncated one".into()),
        Some(length) if length > MAX_HEADER => return Err(format!("its header promises {length} bytes")),
        Some(_) => {}
    }
    let unreadable = |e| format!("not a safetensors file, or a truncated one ({e})");
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(unreadable)?;
    let text = metadata.metadata().as_ref().and_then(|all| all.get(KEY));
    let text = text.ok_or("a safetensors file, but not weights of this decoder")?;
    let rest = text
        .strip_prefix(FORMAT)
        .ok_or_else(|| format!("it is not of the format {FORMAT:?}"))?;
    let words: Vec<&str> = rest.split_whitespace().collect();
    let &["bits", bits, "seed", seed, "id", id] = words.as_slice() else {
        return Err("its metadata does not tell bits, seed and id".into());
    };
    let bits: usize = bits.parse().map_err(|_| format!("{bits:?} is no number of bits"))?;
    if !(1..=MAX_BITS).contains(&bits) {
        return Err(format!("{bits} bits are outside 1 to {MAX_BITS}"));
    }
    let seed = seed.parse().map_err(|_| format!("{seed:?} is no seed"))?;

    let file = SafeTensors::deserialize(bytes).map_err(unreadable)?;
    let shapes = shapes(bits);
    if file.len() != shapes.len() {
        return Err(format!("it holds {} tensors, not {}", file.len(), shapes.len()));
    }
    let tensors = shapes.iter().map(|(name, shape)| tensor(&file, name, shape));
    let mut tensors = tensors.collect::<Result<Vec<_>, _>>()?.into_iter();
    let mut take = || tensors.next().unwrap_or_default();
    let blocks: [Block; BLOCKS] = std::array::from_fn(|_| Block {
        kernel: take(),
        gain: take(),
        shift: take(),
    });
    let (head, bias) = (take(), take());
    let weights = Weights {
        bits,
        seed,
        blocks,
        head,
        bias,
    };
    Ok((weights, id.into()))
}

fn tensor(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
    let view = file.tensor(name).map_err(|_| format!("{name} is missing"))?;
    if view.dtype() != Dtype::F32 || view.shape() != shape {
        let (dtype, found) = (view.dtype(), view.shape());
        return Err(format!("{name} is {dtype:?} {found:?}, not F32 {shape:?}"));
    }
    // Shape and type fix the length, which safetensors has compared with the file's.
    let numbers = view.data().as_chunks::<4>().0.iter();
    Ok(numbers.map(|bytes| f32::from_le_bytes(*bytes)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights() -> Weights {
        Weights::seeded(5, 7).unwrap()
    }

    fn reason(bytes: &[u8]) -> String {
        Weights::from_bytes("w", bytes).unwrap_err().to_string()
    }

    #[test]
    fn round_trip_is_exact_and_bytes_repeat() {
        let weights = weights();
        let bytes = weights.to_bytes().unwrap();
        assert_eq!(Weights::from_bytes("w", &bytes).unwrap(), weights);
        assert_eq!(weights.clone().to_bytes().unwrap(), bytes);
        let most = Weights::seeded(MAX_BITS, 7).unwrap().to_bytes().unwrap();
        assert!(most.len() < MAX_BYTES / 4, "{}", most.len());
    }

    #[test]
    fn the_id_covers_seed_and_values() {
        let id = weights().id();
        assert_eq!(id.len(), 64);
        let mut other = weights();
        other.seed += 1;
        assert_ne!(other.id(), id);
        let mut other = weights();
        other.bias[4] = f32::MIN_POSITIVE;
        assert_ne!(other.id(), id);
    }

    #[test]
    fn truncation_anywhere_is_found() {
        let bytes = weights().to_bytes().unwrap();
        for length in (0..bytes.len()).step_by(9973).chain([0, 7, 8, 9, bytes.len() - 1]) {
            assert!(reason(&bytes[..length]).starts_with("w: "), "{length}");
        }
    }

    #[test]
    fn damage_is_named() {
        let bytes = weights().to_bytes().unwrap();
        let with = |from: &[u8], to: &[u8]| {
            let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
            let mut changed = bytes.clone();
            changed[at..at + to.len()].copy_from_slice(to);
            reason(&changed)
        };
        assert!(with(b"hidden 1", b"hidden 2").contains("not of the format"));
        assert!(with(b"bits 5", b"bits 0").contains("0 bits are outside 1 to 128"));
        assert!(with(b"bits 5", b"bits 6").contains("head.weight is F32 [96, 5], not F32 [96, 6]"));
        assert!(with(b"seed 7", b"seed 8").contains("does not match its id"));
        assert!(with(b"seed 7", b"seed x").contains("no seed"));
        assert!(with(b"guardsplat_hidden", b"guardsplat_hiddem").contains("not weights of this decoder"));
        assert!(with(b"head.bias", b"head.bia5").contains("head.bias is missing"));
        let mut last = bytes.clone();
        let end = last.len() - 1;
        last[end] ^= 1;
        assert!(reason(&last).contains("does not match its id"));
        assert!(reason(&[0xff; 64]).contains("its header promises"));
        assert!(reason(&vec![0; MAX_BYTES + 1]).contains("larger than"));
        let mut infinite = weights();
        infinite.blocks[2].gain[3] = f32::INFINITY;
        assert!(reason(&infinite.to_bytes().unwrap()).contains("block.2.gain holds inf"));
    }
}
