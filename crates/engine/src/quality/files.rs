//! Picture files: PNG, JPEG, WebP and OpenEXR, with limits on what is decoded.
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Write};
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, RgbImage};

use super::{animation, exr};
use crate::error::{Error, Result};
use crate::picture::Picture;

/// Most pixels of a picture that is decoded: 64 megapixels, 768 MiB as f32 RGB.
pub const MAX_PIXELS: u64 = 64_000_000;
/// Largest picture file that is read.
pub const MAX_BYTES: u64 = 1 << 30;
/// What a decoder may allocate: 64 megapixels of four 16-bit channels, and room to work.
const MAX_ALLOCATION: u64 = 1 << 30;
/// JPEG quality where none is asked for.
pub const JPEG_QUALITY: u8 = 95;

/// A format that pictures are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// 8 bits a channel, lossless.
    Png,
    /// 8 bits a channel, lossy, quality 1 to 100.
    Jpeg(u8),
    /// 8 bits a channel, lossless.
    WebP,
    /// 32-bit float, the values as they are.
    Exr,
}

impl PictureFormat {
    /// The format of a file name's extension. Fails on any other.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or("")
            .to_ascii_lowercase();
        match extension.as_str() {
            "png" => Ok(Self::Png),
            "jpg" | "jpeg" => Ok(Self::Jpeg(JPEG_QUALITY)),
            "webp" => Ok(Self::WebP),
            "exr" => Ok(Self::Exr),
            _ => Err(bad(path, "its extension is none of png, jpg, jpeg, webp, exr".into())),
        }
    }
}

fn bad(path: &Path, reason: String) -> Error {
    Error::BadPicture {
        path: path.into(),
        reason,
    }
}

/// The picture as a file's bytes; 8-bit formats clamp to [0, 1] and round.
///
/// # Errors
/// Says why in words: pixels that do not fit the size, no pixels, or more than the format can hold.
pub fn encode_picture(picture: &Picture, format: PictureFormat) -> Result<Vec<u8>, String> {
    let (width, height) = (picture.width, picture.height);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("{width} x {height} pixels are more than {MAX_PIXELS}"));
    }
    let does_not_fit = || format!("{} values are not {width} x {height} pixels", picture.pixels.len());
    if picture.pixels.is_empty() || picture.pixels.len() != 3 * width as usize * height as usize {
        return Err(does_not_fit());
    }
    let image = if format == PictureFormat::Exr {
        image::Rgb32FImage::from_raw(width, height, picture.pixels.clone()).map(DynamicImage::ImageRgb32F)
    } else {
        // NaN becomes 0.
        let bytes = picture
            .pixels
            .iter()
            .map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
            .collect();
        RgbImage::from_raw(width, height, bytes).map(DynamicImage::ImageRgb8)
    };
    let image = image.ok_or_else(does_not_fit)?;
    let mut bytes = Cursor::new(Vec::new());
    match format {
        PictureFormat::Png => image.write_to(&mut bytes, ImageFormat::Png),
        PictureFormat::Jpeg(quality) => {
            image.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100)))
        }
        PictureFormat::WebP => image.write_to(&mut bytes, ImageFormat::WebP),
        PictureFormat::Exr => image.write_to(&mut bytes, ImageFormat::OpenExr),
    }
    .map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

/// Whether a file that begins with these bytes is a picture of one of the four formats, if one that may be damaged.
pub fn is_picture(head: &[u8]) -> bool {
    use ImageFormat::{Jpeg, OpenExr, Png, WebP};
    matches!(image::guess_format(head), Ok(Png | Jpeg | WebP | OpenExr))
}

/// A picture from a file's bytes, whatever of the four formats they are in. The camera's orientation is applied, and
/// transparent pixels show `background` through.
///
/// # Errors
/// Says why in words: an unknown format, an animation, damage, more than [`MAX_PIXELS`], or values that are not finite.
pub fn decode_picture(bytes: &[u8], background: [f32; 3]) -> Result<Picture, String> {
    let picture = if exr::is_exr(bytes) {
        exr::decode(bytes, background)?
    } else {
        decode_integers(bytes, background)?
    };
    let Picture { width, pixels, .. } = &picture;
    if let Some(at) = pixels.iter().position(|v: &f32| !v.is_finite()) {
        let (x, y) = (at / 3 % *width as usize, at / 3 / *width as usize);
        return Err(format!("pixel ({x}, {y}) is {}", pixels[at]));
    }
    if pixels.is_empty() {
        return Err("it has no pixels".into());
    }
    Ok(picture)
}

/// A picture of a format that `image` reads within limits: all but OpenEXR.
fn decode_integers(bytes: &[u8], background: [f32; 3]) -> Result<Picture, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_ALLOCATION);
    reader.limits(limits.clone());
    if reader.format().is_none() {
        return Err("not a PNG, JPEG, WebP or OpenEXR picture".into());
    }
    animation::refuse(bytes, reader.format(), &limits)?;
    let mut decoder = reader.into_decoder().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("{width} x {height} pixels are more than {MAX_PIXELS}"));
    }
    let orientation = decoder.orientation().map_err(|e| e.to_string())?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?;
    image.apply_orientation(orientation);
    let (width, height) = (image.width(), image.height());
    let pixels = if image.color().has_alpha() {
        over(image.into_rgba32f().into_raw(), background)
    } else {
        image.into_rgb32f().into_raw()
    };
    Ok(Picture { width, height, pixels })
}

/// Pixels of four values to such of three, in place: a copy would be the largest thing in memory.
fn over(mut pixels: Vec<f32>, background: [f32; 3]) -> Vec<f32> {
    let count = pixels.len() / 4;
    for i in 0..count {
        let alpha = pixels[4 * i + 3];
        for (channel, behind) in background.into_iter().enumerate() {
            pixels[3 * i + channel] = pixels[4 * i + channel] * alpha + behind * (1.0 - alpha);
        }
    }
    pixels.truncate(3 * count);
    pixels.shrink_to_fit();
    pixels
}

/// Reads a picture file as [`decode_picture`] does. Fails with [`Error::BadPicture`], or [`Error::Io`].
pub fn read_picture(path: &Path, background: [f32; 3]) -> Result<Picture> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    BufReader::new(file)
        .take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(Error::io(path))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(bad(path, format!("it is larger than {MAX_BYTES} bytes")));
    }
    decode_picture(&bytes, background).map_err(|reason| bad(path, reason))
}

/// Writes a picture in the format of the file's extension, whole or not at all.
pub fn write_picture(path: &Path, picture: &Picture) -> Result<()> {
    let bytes = encode_picture(picture, PictureFormat::of(path)?).map_err(|reason| bad(path, reason))?;
    let parent = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        // Unlike a key, a picture is for everyone whom the process's umask lets read.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(parent).map_err(Error::io(path))?;
    file.write_all(&bytes).map_err(Error::io(path))?;
    file.persist(path).map_err(|e| Error::io(path)(e.error))?;
    Ok(())
}

#[cfg(test)]
mod tests;
