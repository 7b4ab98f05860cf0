//! How large pictures may be.
use crate::{Error, Result};

/// Largest side of a picture, in pixels, before and after an attack; the format WebP knows no larger ones.
pub const MAX_SIDE: u32 = 16_383;
/// Most pixels of a picture before and after an attack, some more than 7680 × 4320.
pub const MAX_PIXELS: u64 = 1 << 25;

/// Refuses sides of zero and more than [`MAX_SIDE`] or [`MAX_PIXELS`].
pub(super) fn check((width, height): (u32, u32)) -> Result<()> {
    let fits = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    if fits && u64::from(width) * u64::from(height) <= MAX_PIXELS {
        return Ok(());
    }
    Err(Error::BadOption {
        field: "size of the picture",
        reason: format!("{width}x{height} is not 1 to {MAX_SIDE} pixels a side and at most {MAX_PIXELS} in all"),
    })
}

/// `share` of a side, to the nearest pixel and at least one.
pub(super) fn share_of(side: u32, share: f64) -> u32 {
    // Saturates, so that `check` sees what is too large.
    ((f64::from(side) * share).round() as u32).max(1)
}
