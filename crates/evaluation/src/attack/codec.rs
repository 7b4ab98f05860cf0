//! JPEG and lossy WebP: written and read again.
use image::codecs::{jpeg::JpegDecoder, webp::WebPDecoder};
use image::{DynamicImage, RgbImage};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use std::io::Cursor;

use crate::{Error, Result};

/// Baseline JPEG of a quality of 1 to 100, with the tables of libjpeg (ITU-T T.81, annex K) and 4:2:0 at every quality.
///
/// Loses as much as libjpeg-turbo does up to quality 75, and some tenths of a dB more at 95, by the encoder's arithmetic.
pub(super) fn jpeg(picture: &RgbImage, quality: u8) -> Result<RgbImage> {
    let side = |side: u32| u16::try_from(side).map_err(|error| failed("jpeg", error));
    let (width, height) = (side(picture.width())?, side(picture.height())?);
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, quality);
    // Left alone, it writes 4:4:4 from quality 90 on.
    encoder.set_sampling_factor(SamplingFactor::R_4_2_0);
    encoder
        .encode(picture, width, height, ColorType::Rgb)
        .map_err(|error| failed("jpeg", error))?;
    let decoder = JpegDecoder::new(Cursor::new(file));
    let decoded = decoder.and_then(DynamicImage::from_decoder);
    Ok(decoded.map_err(|error| failed("jpeg", error))?.into_rgb8())
}

/// Lossy WebP of a quality of 0 to 100.
pub(super) fn webp(picture: &RgbImage, quality: f32) -> Result<RgbImage> {
    let encoder = webp::Encoder::from_rgb(picture, picture.width(), picture.height());
    let file = encoder
        .encode_simple(false, quality)
        .map_err(|error| failed("webp", format!("{error:?}")))?;
    let decoder = WebPDecoder::new(Cursor::new(&*file));
    let decoded = decoder.and_then(DynamicImage::from_decoder);
    Ok(decoded.map_err(|error| failed("webp", error))?.into_rgb8())
}

fn failed(codec: &'static str, reason: impl ToString) -> Error {
    Error::Codec {
        codec,
        reason: reason.to_string(),
    }
}
