//! JPEG by libjpeg-turbo and mozjpeg: written and read again by the C code behind most such files.
//!
//! One library has both: mozjpeg is libjpeg-turbo with an encoder of its own, and writes libjpeg-turbo's files when it is
//! asked to be fast.
use std::io;
use std::panic::catch_unwind;

use image::RgbImage;
use mozjpeg::{ColorSpace, Compress, Decompress};

use crate::{Error, Result};

/// What writes the file; both read it alike.
#[derive(Clone, Copy)]
pub(super) enum Encoder {
    /// Baseline, with the tables of libjpeg.
    Turbo,
    /// Progressive, with mozjpeg's tables, and coefficients chosen by what they cost in bits (trellis quantisation).
    Mozjpeg,
}

impl Encoder {
    fn name(self) -> &'static str {
        match self {
            Self::Turbo => "jpeg-turbo",
            Self::Mozjpeg => "mozjpeg",
        }
    }
}

/// JPEG of a quality of 1 to 100 and 4:2:0 at every quality, as `cjpeg` writes it unless asked otherwise.
pub(super) fn written(encoder: Encoder, picture: &RgbImage, quality: u8) -> Result<RgbImage> {
    let failed = |reason: String| Error::Codec {
        codec: encoder.name(),
        reason,
    };
    // The library tells errors by unwinding.
    let pixels = catch_unwind(|| read(&write(encoder, picture, quality)?))
        .map_err(|_| failed("the library refused the picture".into()))?
        .map_err(|error| failed(error.to_string()))?;
    RgbImage::from_raw(picture.width(), picture.height(), pixels)
        .ok_or_else(|| failed("what was read has another size".into()))
}

fn write(encoder: Encoder, picture: &RgbImage, quality: u8) -> io::Result<Vec<u8>> {
    let mut compress = Compress::new(ColorSpace::JCS_RGB);
    if matches!(encoder, Encoder::Turbo) {
        compress.set_fastest_defaults();
    }
    compress.set_size(picture.width() as usize, picture.height() as usize);
    compress.set_quality(f32::from(quality));
    let mut started = compress.start_compress(Vec::new())?;
    started.write_scanlines(picture)?;
    started.finish()
}

fn read(file: &[u8]) -> io::Result<Vec<u8>> {
    let mut started = Decompress::new_mem(file)?.rgb()?;
    let pixels = started.read_scanlines::<u8>()?;
    started.finish()?;
    Ok(pixels)
}
