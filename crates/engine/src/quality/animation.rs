//! Animations among picture files: APNG and animated WebP, which decoders read the first frame of without a word.
use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{ImageFormat, Limits};

/// Refuses animations: which frame is meant is not for the program to guess, least of all where a claim hangs on it.
/// Looks at headers only.
///
/// # Errors
/// Says so in words, or what is wrong with the header.
pub(super) fn refuse(bytes: &[u8], format: Option<ImageFormat>, limits: &Limits) -> Result<(), String> {
    let moves = match format {
        Some(ImageFormat::Png) => {
            PngDecoder::with_limits(Cursor::new(bytes), limits.clone()).and_then(|decoder| decoder.is_apng())
        }
        Some(ImageFormat::WebP) => WebPDecoder::new(Cursor::new(bytes)).map(|decoder| decoder.has_animation()),
        _ => Ok(false),
    };
    match moves {
        Ok(false) => Ok(()),
        Ok(true) => Err("it is an animation; save the frames that are meant as pictures of their own".into()),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use image::RgbImage;

    use crate::quality::decode_picture;

    fn encoded(format: image::ImageFormat) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        RgbImage::new(4, 3).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    /// The checksum of a chunk of a PNG.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| {
                (c >> 1) ^ (0xEDB8_8320 & (c & 1).wrapping_neg())
            })
        })
    }

    /// A PNG that says after its header (33 bytes) that it has two frames.
    fn apng() -> Vec<u8> {
        let mut png = encoded(image::ImageFormat::Png);
        let mut chunk = b"acTL\0\0\0\x02\0\0\0\0".to_vec();
        chunk.extend(crc32(&chunk).to_be_bytes());
        png.splice(33..33, [&8_u32.to_be_bytes()[..], &chunk].concat());
        png
    }

    /// A WebP with one frame that is shown for a tenth of a second.
    fn animated_webp() -> Vec<u8> {
        let still = encoded(image::ImageFormat::WebP);
        let chunk = |name: &[u8], data: &[u8]| [name, &(data.len() as u32).to_le_bytes()[..], data].concat();
        // The canvas and the frame: their sizes less one, in three bytes each.
        let size = [3, 0, 0, 2, 0, 0];
        let header = chunk(b"VP8X", &[&[2, 0, 0, 0][..], &size].concat());
        let frame = [&[0; 6][..], &size, &[100, 0, 0, 0], &still[12..]].concat();
        let rest = [header, chunk(b"ANIM", &[0; 6]), chunk(b"ANMF", &frame)].concat();
        [&b"RIFF"[..], &(4 + rest.len() as u32).to_le_bytes(), b"WEBP", &rest].concat()
    }

    #[test]
    fn animations_are_refused_and_stills_are_not() {
        for still in [
            image::ImageFormat::Png,
            image::ImageFormat::WebP,
            image::ImageFormat::Jpeg,
        ] {
            assert!(decode_picture(&encoded(still), [0.0; 3]).is_ok(), "{still:?}");
        }
        for (name, bytes) in [("APNG", apng()), ("WebP", animated_webp())] {
            // Decoders take them, and give the first frame.
            assert!(image::load_from_memory(&bytes).is_ok(), "{name}");
            let reason = decode_picture(&bytes, [0.0; 3]).unwrap_err();
            assert!(reason.contains("animation"), "{name}: {reason}");
        }
    }
}
