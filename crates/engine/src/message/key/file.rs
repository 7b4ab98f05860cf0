//! The key file: a safetensors container whose metadata holds one JSON text, `guardsplat_key`.
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::{ClipIdentity, Decoding, Key, Secret};
use crate::clip::check_header;
use crate::error::{Error, Result};
use crate::message::decoder::{DecoderWeights, HIDDEN, LayerWeights};
use crate::message::projection::Projection;
use crate::message::tokens::check_bits_per_token;
use guardsplat_codeword::{MAX_BITS, MessageCode, MessageLength};

/// The format's version; another one is refused.
const VERSION: u32 = 1;
/// Where the JSON text lies in the metadata.
const HEADER: &str = "guardsplat_key";
/// Largest file that is read, here and by whoever has it sent; the widest key of a CLIP of 1024 dimensions has 13 MiB.
pub const MAX_BYTES: u64 = 256 << 20;

#[derive(Serialize, Deserialize)]
struct Header {
    version: u32,
    id: String,
    bits: usize,
    /// Bits of the words that messages are put into; without it they are embedded bit by bit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    word_bits: Option<usize>,
    #[serde(default = "one")]
    bits_per_token: usize,
    #[serde(default = "three")]
    layers: usize,
    /// What reads pictures; CLIP unless it is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    extractor: Option<String>,
    secret: String,
    seed: Option<u64>,
    clip: ClipIdentity,
    accuracy_unseen: Option<f64>,
    accuracy_unseen_noisy: Option<f64>,
}

impl Header {
    /// Bits of what is embedded.
    fn word_bits(&self) -> usize {
        self.word_bits.unwrap_or(self.bits)
    }
}

/// Keys of more than one bit a token came later.
fn one() -> usize {
    1
}

/// Keys with linear decoders came later, too.
fn three() -> usize {
    3
}

/// What the header calls a convolutional decoder, and its tensors' names begin with.
const HIDDEN_DECODER: &str = "hidden";

/// One tensor of a key.
pub(super) struct Named<'a> {
    name: String,
    shape: Vec<usize>,
    values: &'a [f32],
}

impl Named<'_> {
    /// The values as the file holds them.
    pub(super) fn little_endian(&self) -> Vec<u8> {
        self.values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }
}

/// All tensors of a key, in the order that its id covers them.
pub(super) fn tensors(key: &Key) -> Vec<Named<'_>> {
    let (projection, decoder) = match &key.decoding {
        Decoding::Clip { projection, decoder } => (projection, decoder),
        Decoding::Hidden(weights) => {
            let all = weights.tensors().into_iter();
            return all
                .map(|tensor| Named {
                    name: format!("{HIDDEN_DECODER}.{}", tensor.name),
                    shape: tensor.shape,
                    values: tensor.values,
                })
                .collect();
        }
    };
    let parts = projection.parts().into_iter();
    let mut all: Vec<_> = parts
        .map(|(name, shape, values)| Named {
            name: name.into(),
            shape,
            values,
        })
        .collect();
    for (i, layer) in decoder.layers.iter().enumerate() {
        let (inputs, outputs) = (layer.inputs, layer.outputs);
        all.push(Named {
            name: format!("decoder.{i}.weight"),
            shape: vec![inputs, outputs],
            values: &layer.weight,
        });
        all.push(Named {
            name: format!("decoder.{i}.bias"),
            shape: vec![outputs],
            values: &layer.bias,
        });
    }
    all
}

/// Writes `key` whole or not at all, for its owner only.
pub(super) fn write(key: &Key, path: &Path) -> Result<()> {
    let bytes = serialize(key).map_err(|reason| Error::BadKey {
        path: path.into(),
        reason,
    })?;
    let parent = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    // A temporary file of this crate has mode 0600 on Unix, and keeps it when it is renamed.
    let mut file = tempfile::NamedTempFile::new_in(parent).map_err(Error::io(path))?;
    file.write_all(&bytes).map_err(Error::io(path))?;
    file.as_file().sync_all().map_err(Error::io(path))?;
    file.persist(path).map_err(|e| Error::io(path)(e.error))?;
    Ok(())
}

/// The file's bytes.
pub(super) fn serialize(key: &Key) -> Result<Vec<u8>, String> {
    let (layers, extractor) = match &key.decoding {
        Decoding::Clip { decoder, .. } => (decoder.layers.len(), None),
        Decoding::Hidden(_) => (0, Some(HIDDEN_DECODER.into())),
    };
    let header = Header {
        version: VERSION,
        id: key.id(),
        bits: key.bits(),
        word_bits: key.coded_bits.map(|_| key.word_bits()),
        bits_per_token: key.bits_per_token,
        layers,
        extractor,
        secret: hex::encode(key.secret.expose()),
        seed: key.seed,
        clip: key.clip.clone(),
        accuracy_unseen: key.accuracy_unseen,
        accuracy_unseen_noisy: key.accuracy_unseen_noisy,
    };
    let json = serde_json::to_string(&header).map_err(|e| e.to_string())?;
    let mut little_endian = Vec::new();
    for tensor in tensors(key) {
        let bytes = tensor.little_endian();
        little_endian.push((tensor.name, tensor.shape, bytes));
    }
    let mut views = Vec::new();
    for (name, shape, bytes) in &little_endian {
        let view = TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(|e| e.to_string())?;
        views.push((name.as_str(), view));
    }
    // A single metadata entry, because the order of several would change from run to run.
    let metadata = HashMap::from([(HEADER.to_string(), json)]);
    safetensors::serialize(views, Some(metadata)).map_err(|e| e.to_string())
}

/// Reads a key, at most [`MAX_BYTES`] of it, and checks it against its id.
pub(super) fn read(path: &Path) -> Result<Key> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    file.take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(Error::io(path))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::BadKey {
            path: path.into(),
            reason: format!("it is larger than {MAX_BYTES} bytes"),
        });
    }
    deserialize(&bytes).map_err(|reason| Error::BadKey {
        path: path.into(),
        reason,
    })
}

/// A key from the file's bytes, checked against its id.
pub(super) fn deserialize(bytes: &[u8]) -> Result<Key, String> {
    let not_a_key = |e: &dyn std::fmt::Display| format!("not a key file, or a truncated one ({e})");
    check_header(bytes).map_err(|e| not_a_key(&e))?;
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| not_a_key(&e))?;
    let json = metadata.metadata().as_ref().and_then(|m| m.get(HEADER));
    let json = json.ok_or("a safetensors file, but not a key")?;
    #[derive(Deserialize)]
    struct Version {
        version: u32,
    }
    let bad_header = |e: serde_json::Error| format!("its header cannot be read: {e}");
    let Version { version } = serde_json::from_str(json).map_err(bad_header)?;
    if version != VERSION {
        return Err(format!(
            "its format is version {version}; this program reads version {VERSION}"
        ));
    }
    let header: Header = serde_json::from_str(json).map_err(bad_header)?;
    if MessageLength::new(header.bits).is_err() {
        return Err(format!("{} bits are outside 1 to {MAX_BITS}", header.bits));
    }
    check_bits_per_token(header.word_bits(), header.bits_per_token).map_err(|e| e.to_string())?;
    let coded = MessageLength::CODED.bits() as usize;
    if header
        .word_bits
        .is_some_and(|word| word != coded || !MessageCode::is_for(header.bits))
    {
        let (bits, word) = (header.bits, header.word_bits());
        return Err(format!("messages of {bits} bits are not put into words of {word}"));
    }
    let mut secret = [0; 32];
    hex::decode_to_slice(&header.secret, &mut secret).map_err(|_| "its secret is not 64 hexadecimal digits")?;

    let file = SafeTensors::deserialize(bytes).map_err(|e| not_a_key(&e))?;
    let decoding = match header.extractor.as_deref() {
        None => clip_decoding(&file, &header)?,
        Some(HIDDEN_DECODER) => {
            let read = |name: &str, shape: &[usize]| tensor(&file, &format!("{HIDDEN_DECODER}.{name}"), shape);
            let weights = guardsplat_hidden::Weights::from_tensors("decoder", header.word_bits(), read);
            Decoding::Hidden(weights.map_err(|e| e.to_string())?)
        }
        Some(other) => {
            return Err(format!(
                "it reads pictures with {other:?}, which this program does not know"
            ));
        }
    };
    let key = Key {
        secret: Secret::new(secret),
        seed: header.seed,
        coded_bits: header.word_bits.map(|_| header.bits),
        bits_per_token: header.bits_per_token,
        clip: header.clip,
        decoding,
        accuracy_unseen: header.accuracy_unseen,
        accuracy_unseen_noisy: header.accuracy_unseen_noisy,
    };
    // The id covers secret, weights, projection and CLIP, so it finds what the checks above let pass.
    if key.id() != header.id {
        return Err(format!(
            "its content does not match its id {}: the file is damaged",
            header.id
        ));
    }
    Ok(key)
}

/// Projection and decoder of a key that reads CLIP's features.
fn clip_decoding(file: &SafeTensors<'_>, header: &Header) -> Result<Decoding, String> {
    let matrix = file.tensor("projection.matrix_image").map_err(|e| e.to_string())?;
    let &[width, rank] = matrix.shape() else {
        return Err("projection.matrix_image is not a matrix".into());
    };
    let read = |name: &str, shape: &[usize]| tensor(file, name, shape);
    let projection = Projection {
        width,
        rank,
        mean_image: read("projection.mean_image", &[width])?,
        mean_text: read("projection.mean_text", &[width])?,
        matrix_image: read("projection.matrix_image", &[width, rank])?,
        matrix_text: read("projection.matrix_text", &[width, rank])?,
        noise: read("projection.noise", &[rank, rank])?,
    };
    projection.check()?;
    let layer = |i: usize, inputs: usize, outputs: usize| -> Result<LayerWeights, String> {
        let weight = read(&format!("decoder.{i}.weight"), &[inputs, outputs])?;
        let bias = read(&format!("decoder.{i}.bias"), &[outputs])?;
        Ok(LayerWeights {
            inputs,
            outputs,
            weight,
            bias,
        })
    };
    let layers = match header.layers {
        1 => vec![layer(0, rank, header.word_bits())?],
        3 => vec![
            layer(0, rank, HIDDEN)?,
            layer(1, HIDDEN, HIDDEN)?,
            layer(2, HIDDEN, header.word_bits())?,
        ],
        other => return Err(format!("its decoder has {other} layers, not 1 or 3")),
    };
    let decoder = DecoderWeights { layers };
    decoder.check()?;
    Ok(Decoding::Clip { projection, decoder })
}

fn tensor(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
    let view = file.tensor(name).map_err(|_| format!("{name} is missing"))?;
    if view.dtype() != Dtype::F32 || view.shape() != shape {
        return Err(format!(
            "{name} is {:?} {:?}, not F32 {shape:?}",
            view.dtype(),
            view.shape()
        ));
    }
    // Shape and dtype fix the length, which safetensors has compared with the file's.
    Ok(view
        .data()
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect())
}

#[cfg(test)]
mod tests;
