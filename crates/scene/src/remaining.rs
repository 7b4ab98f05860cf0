//! The bytes that a source still has.
use crate::error::bad;
use crate::{Error, Result};
use std::io::{BufReader, Read};
use std::path::Path;

/// The `left` bytes that a source should still have, or as many as it has: one that grows while it is read is read up
/// to the size it had.
pub(crate) fn read_remaining(path: &Path, source: &mut BufReader<impl Read>, left: u64) -> Result<Vec<u8>> {
    let mut body = Vec::new();
    usize::try_from(left)
        .ok()
        .and_then(|left| body.try_reserve_exact(left).ok())
        .ok_or_else(|| bad(path, format!("{left} bytes of Gaussians do not fit in memory")))?;
    source.take(left).read_to_end(&mut body).map_err(Error::io(path))?;
    Ok(body)
}
