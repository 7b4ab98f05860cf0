//! How much a compressed file may hold.

/// Bytes for each byte of the file. Scenes are compressed to a half or a fifth; gzip could do 1,032 times and zstd
/// more, with which a file of some megabytes would fill any memory.
const RATIO: u64 = 64;
/// Bytes that any file may hold: the few Gaussians of a tiny file can be all alike.
const SLACK: u64 = 1 << 20;
/// Bytes that no file may hold more than: 90 million Gaussians of degree 4, more than a worker has memory for.
const MOST: u64 = 8 << 30;
/// Bytes that may follow the Gaussians in a gzip stream. Extensions there are cameras and the like.
pub(super) const MOST_AFTER: u64 = 16 << 20;

/// Compares the bytes that a header promises with those of the file; `Err` is the reason for which it is refused.
pub(crate) fn check(promised: u64, file: u64) -> Result<(), String> {
    let allowed = file.saturating_mul(RATIO).saturating_add(SLACK).min(MOST);
    if promised <= allowed {
        return Ok(());
    }
    Err(format!(
        "the header promises Gaussians of {promised} bytes; a file of {file} bytes may hold {allowed} at most"
    ))
}
