//! Thumbnails of the pictures that were read, for people who look at the evidence.
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::{PictureFormat, encode_picture};
use guardsplat_engine::{Error, Result};
use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Rgb};

/// Most pictures that are kept.
const MOST: usize = 4;
/// Their largest side in pixels.
const SIDE: u32 = 320;

/// The first pictures of a reading as PNGs, with what they show.
#[derive(Default)]
pub struct Thumbnails(pub Vec<(String, Vec<u8>)>);

impl Thumbnails {
    /// Takes a picture in if there is room; `index` counts from 0.
    ///
    /// # Errors
    /// A picture whose numbers are not those of its pixels.
    pub fn see(&mut self, what: &str, index: usize, picture: &Picture) -> Result<()> {
        if self.0.len() < MOST {
            self.0.push((format!("{what} {}", index + 1), small_png(picture)?));
        }
        Ok(())
    }
}

/// A PNG of at most [`SIDE`] pixels a side.
///
/// # Errors
/// A picture whose numbers are not those of its pixels.
pub fn small_png(picture: &Picture) -> Result<Vec<u8>> {
    let bad = |reason: String| Error::BadPicture {
        path: "view".into(),
        reason,
    };
    let (width, height) = (picture.width, picture.height);
    let longest = width.max(height);
    if longest <= SIDE {
        return encode_picture(picture, PictureFormat::Png).map_err(bad);
    }
    let image = ImageBuffer::<Rgb<f32>, _>::from_raw(width, height, picture.pixels.as_slice());
    let image = image.ok_or_else(|| {
        bad(format!(
            "{} numbers for {width} x {height} pixels",
            picture.pixels.len()
        ))
    })?;
    let side = |length: u32| ((u64::from(length) * u64::from(SIDE) / u64::from(longest)) as u32).max(1);
    let small = resize(&image, side(width), side(height), FilterType::Triangle);
    let small = Picture {
        width: small.width(),
        height: small.height(),
        pixels: small.into_raw(),
    };
    encode_picture(&small, PictureFormat::Png).map_err(bad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use guardsplat_engine::quality::decode_picture;

    #[test]
    fn large_pictures_become_small_and_keep_their_shape() {
        let grey = |width: u32, height: u32| Picture {
            width,
            height,
            pixels: vec![0.5; 3 * (width * height) as usize],
        };
        let mut shown = Thumbnails::default();
        for index in 0..9 {
            shown.see("picture", index, &grey(1000, 500)).unwrap();
        }
        assert_eq!(shown.0.len(), MOST);
        assert_eq!(shown.0[1].0, "picture 2");
        let read = decode_picture(&shown.0[0].1, [1.0; 3]).unwrap();
        assert_eq!((read.width, read.height), (320, 160));
        assert!((read.pixels[0] - 0.5).abs() < 0.003);
        let thin = decode_picture(&small_png(&grey(2000, 1)).unwrap(), [1.0; 3]).unwrap();
        assert_eq!((thin.width, thin.height), (320, 1));
        let same = decode_picture(&small_png(&grey(7, 3)).unwrap(), [1.0; 3]).unwrap();
        assert_eq!((same.width, same.height), (7, 3));
    }
}
