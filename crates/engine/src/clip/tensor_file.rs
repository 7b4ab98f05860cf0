//! Safetensors files, read tensor by tensor with everything checked before it is allocated.
use crate::error::{Error, Result};
use safetensors::Dtype;
use safetensors::tensor::Metadata;
use sha2::{Digest, Sha256};
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Largest header that is read, here and of other safetensors files. The largest published CLIP needs 0.1 MB. A shape of
/// many ones takes up to forty times its text while it is parsed.
pub(crate) const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Checks the length that a whole safetensors file states of its header, before somebody believes it.
pub(crate) fn check_header(bytes: &[u8]) -> Result<(), String> {
    match bytes.first_chunk().map(|word| u64::from_le_bytes(*word)) {
        Some(header) if header > MAX_HEADER_BYTES => Err(format!(
            "its header promises {header} bytes, at most {MAX_HEADER_BYTES} are read"
        )),
        _ => Ok(()),
    }
}

/// Where weights come from: a file, or something that makes them (tests).
pub trait TensorSource {
    /// What to call it in error messages.
    fn name(&self) -> &str;
    /// All tensors, with shapes.
    fn tensors(&self) -> Vec<(String, Vec<usize>)>;
    /// The values of one of [`TensorSource::tensors`], as f32, in row-major order.
    ///
    /// # Errors
    /// [`Error::BadModel`] or [`Error::Io`] when it cannot be read.
    fn read(&mut self, tensor: &str) -> Result<Vec<f32>>;
}

trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

/// An open safetensors file whose header was read and checked against the file's length.
pub struct TensorFile {
    name: String,
    bytes: Box<dyn ReadSeek>,
    metadata: Metadata,
    /// Where tensor data begins.
    start: u64,
}

impl TensorFile {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read, [`Error::BadModel`] when it is not a whole safetensors file.
    pub fn open(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(Error::io(path))?;
        Self::from_reader(path.display().to_string(), Box::new(file))
    }

    /// A file that is in memory; `name` is for error messages.
    ///
    /// # Errors
    /// [`Error::BadModel`] as for [`TensorFile::open`].
    pub fn from_bytes(name: &str, bytes: impl AsRef<[u8]> + 'static) -> Result<Self> {
        Self::from_reader(name.to_owned(), Box::new(Cursor::new(bytes)))
    }

    fn from_reader(name: String, mut bytes: Box<dyn ReadSeek>) -> Result<Self> {
        let bad = |reason: String| Error::BadModel {
            name: name.clone(),
            reason,
        };
        let io = |source| Error::Io {
            path: name.clone().into(),
            source,
        };
        let length = bytes.seek(SeekFrom::End(0)).map_err(io)?;
        if length < 8 {
            return Err(bad(format!("is {length} bytes, too short for a safetensors file")));
        }
        bytes.rewind().map_err(io)?;
        let mut word = [0; 8];
        bytes.read_exact(&mut word).map_err(io)?;
        let header = u64::from_le_bytes(word);
        if header > MAX_HEADER_BYTES.min(length - 8) {
            return Err(bad(format!(
                "header promises {header} bytes, at most {MAX_HEADER_BYTES} are read and the file has {length}"
            )));
        }
        let mut text = vec![0; header as usize];
        bytes.read_exact(&mut text).map_err(io)?;
        // The deserialiser checks that offsets are gapless and agree with shapes and types.
        let metadata: Metadata = serde_json::from_slice(&text).map_err(|e| bad(format!("safetensors header: {e}")))?;
        let (expected, found) = (metadata.data_len() as u64, length - 8 - header);
        if expected != found {
            return Err(bad(format!(
                "is truncated or has a tail: {expected} bytes of tensors expected, {found} found"
            )));
        }
        Ok(Self {
            start: 8 + header,
            name,
            bytes,
            metadata,
        })
    }

    /// SHA-256 of the whole file, in hexadecimal.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read.
    pub fn sha256(&mut self) -> Result<String> {
        self.bytes.rewind().map_err(Error::io(&self.name))?;
        hash(&mut self.bytes).map_err(Error::io(&self.name))
    }
}

/// SHA-256 of everything that `reader` gives, in hexadecimal.
pub(crate) fn hash(reader: &mut impl Read) -> std::io::Result<String> {
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match reader.read(&mut buffer)? {
            0 => return Ok(hex::encode(hasher.finalize())),
            n => hasher.update(&buffer[..n]),
        }
    }
}

impl TensorSource for TensorFile {
    fn name(&self) -> &str {
        &self.name
    }

    fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.metadata
            .tensors()
            .into_iter()
            .map(|(name, info)| (name, info.shape.clone()))
            .collect()
    }

    fn read(&mut self, tensor: &str) -> Result<Vec<f32>> {
        let bad = |reason: String| Error::BadModel {
            name: self.name.clone(),
            reason,
        };
        let info = self
            .metadata
            .info(tensor)
            .ok_or_else(|| bad(format!("tensor {tensor} is missing")))?;
        if !matches!(info.dtype, Dtype::F32 | Dtype::F16 | Dtype::BF16) {
            return Err(bad(format!(
                "tensor {tensor} is {:?}, must be F32, F16 or BF16",
                info.dtype
            )));
        }
        let (from, to) = info.data_offsets;
        let io = Error::io(&self.name);
        let mut raw = vec![0; to - from];
        let read = self
            .bytes
            .seek(SeekFrom::Start(self.start + from as u64))
            .and_then(|_| self.bytes.read_exact(&mut raw));
        read.map_err(io)?;
        let pairs = raw.as_chunks::<2>().0;
        let values: Vec<f32> = match info.dtype {
            Dtype::F16 => pairs.iter().map(|b| half::f16::from_le_bytes(*b).to_f32()).collect(),
            Dtype::BF16 => pairs.iter().map(|b| half::bf16::from_le_bytes(*b).to_f32()).collect(),
            _ => raw.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
        };
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(bad(format!("tensor {tensor} has {} at {i}", values[i]))),
            None => Ok(values),
        }
    }
}
