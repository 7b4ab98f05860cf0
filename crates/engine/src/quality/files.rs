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
mod tests {
    use super::*;
    use crate::testing::largest_difference;

    const BLACK: [f32; 3] = [0.0; 3];

    fn picture() -> Picture {
        let pixels = (0..20 * 12 * 3).map(|i| ((i % 60) as f32 / 59.0 + (i / 60) as f32 / 12.0) / 2.0);
        Picture {
            width: 20,
            height: 12,
            pixels: pixels.collect(),
        }
    }

    #[test]
    fn files_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let wide = Picture {
            pixels: picture().pixels.iter().map(|v| 3.0 * v - 1.0).collect(),
            ..picture()
        };
        for (name, picture, expected, tolerance) in [
            ("a.png", &wide, wide.to_8_bit(), 1e-6),
            ("a.webp", &wide, wide.to_8_bit(), 1e-6),
            ("a.exr", &wide, wide.clone(), 0.0),
            ("a.JPG", &picture(), picture(), 0.06),
        ] {
            let path = folder.path().join(name);
            write_picture(&path, picture).unwrap();
            let back = read_picture(&path, BLACK).unwrap();
            let difference = largest_difference(&back, &expected);
            assert!(difference <= tolerance, "{name}: {difference}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
    }

    #[test]
    fn jpeg_quality_counts() {
        let error = |quality| {
            let bytes = encode_picture(&picture(), PictureFormat::Jpeg(quality)).unwrap();
            largest_difference(&decode_picture(&bytes, BLACK).unwrap(), &picture())
        };
        assert!(error(100) < error(10));
        assert!(error(0) == error(1));
    }

    #[test]
    fn transparent_pixels_show_the_background() {
        let mut image = image::RgbaImage::new(2, 1);
        image.put_pixel(0, 0, image::Rgba([255, 0, 0, 255]));
        image.put_pixel(1, 0, image::Rgba([255, 0, 0, 0]));
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Png).unwrap();
        let decoded = decode_picture(bytes.get_ref(), [0.25, 0.5, 1.0]).unwrap();
        assert_eq!(decoded.pixels, [1.0, 0.0, 0.0, 0.25, 0.5, 1.0]);
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused() {
        // A PNG's size lies in bytes 16 to 24 and is covered by the checksum that follows its header.
        let mut bytes = encode_picture(&picture(), PictureFormat::Png).unwrap();
        bytes[16..20].copy_from_slice(&100_000_u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&100_000_u32.to_be_bytes());
        let checksum = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        let reason = decode_picture(&bytes, BLACK).unwrap_err();
        assert!(
            reason.contains("100000 x 100000 pixels are more than 64000000") || reason.contains("limit"),
            "{reason}"
        );
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| {
                if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 }
            })
        })
    }

    #[test]
    fn damage_and_strangers_are_errors() {
        for format in [
            PictureFormat::Png,
            PictureFormat::Jpeg(90),
            PictureFormat::WebP,
            PictureFormat::Exr,
        ] {
            let bytes = encode_picture(&picture(), format).unwrap();
            assert!(decode_picture(&bytes[..20], BLACK).is_err(), "{format:?}");
        }
        assert!(decode_picture(b"ply\nformat", BLACK).unwrap_err().contains("not a PNG"));
        assert!(decode_picture(b"", BLACK).is_err());
        let mut broken = picture();
        broken.pixels[3 * 21] = f32::NAN;
        let bytes = encode_picture(&broken, PictureFormat::Exr).unwrap();
        assert!(
            decode_picture(&bytes, BLACK)
                .unwrap_err()
                .contains("pixel (1, 1) is NaN")
        );
        let empty = Picture {
            width: 0,
            height: 0,
            pixels: Vec::new(),
        };
        assert!(encode_picture(&empty, PictureFormat::Png).is_err());
        let short = Picture {
            pixels: vec![0.0; 3],
            ..picture()
        };
        assert!(
            encode_picture(&short, PictureFormat::Png)
                .unwrap_err()
                .contains("3 values are not 20 x 12")
        );
    }

    #[test]
    fn errors_name_the_file_and_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_picture(&folder.path().join("a.gif"), &picture())
            .unwrap_err()
            .to_string();
        assert!(error.contains("a.gif") && error.contains("png"));
        assert!(matches!(
            write_picture(&folder.path().join("no/a.png"), &picture()),
            Err(Error::Io { .. })
        ));
        assert!(matches!(
            read_picture(&folder.path().join("a.png"), BLACK),
            Err(Error::Io { .. })
        ));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
