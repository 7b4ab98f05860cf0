//! Pictures of suspects: PNG, JPEG, WebP and OpenEXR.
use crate::memory::bounded;
use guardsplat_engine::quality::decode_picture;
use image::ImageReader;
use std::io::Cursor;

/// Larger pictures take long and show nothing new; those beyond the limit of 64 megapixels are tried, to be refused.
const PIXELS: std::ops::RangeInclusive<u64> = 1 << 20..=64_000_000;
const EXR: &[u8] = b"\x76\x2f\x31\x01";

/// Pictures of all formats.
///
/// A picture may be of any size in next to no bytes, white from end to end: what counts as its file is its pixels as four
/// numbers in single precision.
pub fn picture(data: &[u8]) {
    let size = ImageReader::new(Cursor::new(data)).with_guessed_format();
    let size = size.ok().and_then(|reader| reader.into_dimensions().ok());
    let pixels = size.map_or(0, |(width, height)| u64::from(width) * u64::from(height));
    if PIXELS.contains(&pixels) {
        return;
    }
    let uncompressed = if pixels > *PIXELS.end() {
        0
    } else {
        16 * pixels as usize
    };
    let decoded = bounded(data.len() + uncompressed, || decode_picture(data, [0.25, 0.5, 1.0]));
    if let Ok(picture) = decoded {
        assert_eq!(
            picture.pixels.len(),
            3 * picture.width as usize * picture.height as usize
        );
        assert!(picture.pixels.iter().all(|v| v.is_finite()));
    }
}

/// OpenEXR alone.
pub fn exr(data: &[u8]) {
    if data.starts_with(EXR) {
        picture(data);
    }
}
