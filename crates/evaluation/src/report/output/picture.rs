//! Difference pictures inside a page.
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Widest that a picture is in a page, in pixels; wider ones are made smaller.
pub const MAX_WIDTH: u32 = 640;
/// Largest file that is read, in bytes.
const MAX_BYTES: u64 = 64 << 20;
/// Largest side of a picture that is read, in pixels.
const MAX_SIDE: u32 = 16_384;

/// A PNG as a `data:` address, at most [`MAX_WIDTH`] wide; or the reason why not.
pub fn inlined(path: &Path) -> Result<String, String> {
    let size = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
    if size > MAX_BYTES {
        return Err(format!("{size} bytes, more than {MAX_BYTES}"));
    }
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let mut reader = ImageReader::with_format(Cursor::new(&bytes), ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| e.to_string())?;
    let png = match picture.width() {
        // As it is: encoding it again would gain nothing.
        ..=MAX_WIDTH => bytes,
        width => smaller(&picture, f64::from(MAX_WIDTH) / f64::from(width))?,
    };
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

fn smaller(picture: &DynamicImage, by: f64) -> Result<Vec<u8>, String> {
    let height = (f64::from(picture.height()) * by).round().max(1.0) as u32;
    let small = picture.resize_exact(MAX_WIDTH, height, image::imageops::FilterType::Triangle);
    let mut png = Cursor::new(Vec::new());
    small.write_to(&mut png, ImageFormat::Png).map_err(|e| e.to_string())?;
    Ok(png.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_pictures_are_made_smaller_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        for (width, height, expected) in [(1280, 100, (640, 50)), (640, 7, (640, 7)), (3, 900, (3, 900))] {
            DynamicImage::new_rgb8(width, height).save(&path).unwrap();
            let inlined = inlined(&path).unwrap();
            let text = inlined.strip_prefix("data:image/png;base64,").unwrap();
            let back = image::load_from_memory(&STANDARD.decode(text).unwrap()).unwrap();
            assert_eq!((back.width(), back.height()), expected);
        }
        std::fs::write(&path, "not a picture").unwrap();
        assert!(inlined(&path).is_err());
        assert!(inlined(&folder.path().join("none.png")).is_err());
    }
}
