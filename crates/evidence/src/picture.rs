//! Pictures of a report: PNGs that are named by their hash in the JSON, and are inside the page.
use crate::error::{Error, Result};
use crate::hash::Sha256;
use crate::limits::{COMPARED_PIXELS, PICTURE_BYTES, PICTURE_SIDE};
use serde::{Deserialize, Serialize};
use std::io::Cursor;

/// One view: what was read, and where the original is known, that and the difference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// What it shows, for people.
    pub name: String,
    /// The view of the unmarked scene; for owners only.
    pub original: Option<Picture>,
    /// The picture as it was read.
    pub read: Picture,
    /// Ten times the absolute difference of the two; for owners only.
    pub difference: Option<Picture>,
}

impl View {
    /// The pictures, with what they are, in the order in which they are shown.
    pub fn pictures(&self) -> impl Iterator<Item = (&'static str, &Picture)> {
        let original = self.original.as_ref().map(|p| ("original", p));
        let difference = self.difference.as_ref().map(|p| ("difference \u{d7}10", p));
        [original, Some(("as read", &self.read)), difference]
            .into_iter()
            .flatten()
    }

    /// The same, to be changed.
    pub(crate) fn pictures_mut(&mut self) -> impl Iterator<Item = &mut Picture> {
        let all = [self.original.as_mut(), Some(&mut self.read), self.difference.as_mut()];
        all.into_iter().flatten()
    }
}

/// A PNG. Its bytes are no part of the JSON, which has their hash.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// The hash of the file.
    pub sha256: Sha256,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    #[serde(skip)]
    png: Option<Vec<u8>>,
}

impl Picture {
    /// A picture of the bytes of a PNG file, at most 8 MiB and 4096 pixels a side.
    ///
    /// # Errors
    /// [`Error::TooLarge`], [`Error::BadPicture`].
    pub fn from_png(png: Vec<u8>) -> Result<Self> {
        if png.len() > PICTURE_BYTES {
            return Err(Error::TooLarge {
                what: "a picture".into(),
                bytes: png.len() as u64,
                limit: PICTURE_BYTES as u64,
            });
        }
        let reader = decoder(&png).read_info().map_err(bad)?;
        let (width, height) = reader.info().size();
        if width.max(height) > PICTURE_SIDE {
            return Err(Error::BadPicture(format!(
                "it is {width} x {height} pixels, at most {PICTURE_SIDE} a side are shown"
            )));
        }
        Ok(Self {
            sha256: Sha256::of(&png),
            width,
            height,
            png: Some(png),
        })
    }

    /// The bytes of the file; absent in a report that was read from JSON.
    pub fn png(&self) -> Option<&[u8]> {
        self.png.as_deref()
    }

    /// Takes the bytes over if they are those of this picture.
    pub(crate) fn fill(&mut self, png: &[u8]) -> bool {
        let ours = Sha256::of(png) == self.sha256;
        if ours {
            self.png = Some(png.to_vec());
        }
        ours
    }

    /// min(255, 10·|a − b|) of each colour channel: what a mark changed, made visible. Alpha is left out.
    ///
    /// # Errors
    /// [`Error::BadPicture`] for pictures of different sizes, of more than four megapixels, or without their bytes.
    pub fn difference(a: &Self, b: &Self) -> Result<Self> {
        if (a.width, a.height) != (b.width, b.height) {
            return Err(Error::BadPicture(format!(
                "a picture of {} x {} pixels has no difference to one of {} x {}",
                a.width, a.height, b.width, b.height
            )));
        }
        let (mut values, other) = (a.rgb()?, b.rgb()?);
        for (value, other) in values.iter_mut().zip(other) {
            *value = value.abs_diff(other).saturating_mul(10);
        }
        Self::from_rgb(a.width, a.height, &values)
    }

    /// A PNG of 8-bit colours, three bytes a pixel, row by row from the top.
    ///
    /// # Errors
    /// [`Error::BadPicture`] where there are too many or too few bytes.
    pub fn from_rgb(width: u32, height: u32, rgb: &[u8]) -> Result<Self> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let written = encoder.write_header().and_then(|mut out| out.write_image_data(rgb));
        written.map_err(|e| Error::BadPicture(e.to_string()))?;
        Self::from_png(file)
    }

    /// Colours as three bytes a pixel, from a PNG of any kind.
    pub(crate) fn rgb(&self) -> Result<Vec<u8>> {
        let png = self
            .png()
            .ok_or_else(|| Error::BadPicture("its bytes are absent".into()))?;
        let pixels = u64::from(self.width) * u64::from(self.height);
        if pixels > COMPARED_PIXELS {
            return Err(Error::BadPicture(format!(
                "it has {pixels} pixels, at most {COMPARED_PIXELS} are compared"
            )));
        }
        let mut decoder = decoder(png);
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        let mut reader = decoder.read_info().map_err(bad)?;
        let size = reader.output_buffer_size();
        let mut buffer = vec![0; size.ok_or_else(|| Error::BadPicture("it has too many pixels".into()))?];
        let frame = reader.next_frame(&mut buffer).map_err(bad)?;
        buffer.truncate(frame.buffer_size());
        let channels = frame.color_type.samples();
        let pixels = buffer.chunks_exact(channels);
        Ok(match channels {
            1 | 2 => pixels.flat_map(|p| p.iter().take(1).cycle().take(3)).copied().collect(),
            _ => pixels.flat_map(|p| p.iter().take(3)).copied().collect(),
        })
    }
}

/// A decoder that takes no more memory than pictures of the largest size need.
fn decoder(png: &[u8]) -> png::Decoder<Cursor<&[u8]>> {
    let bytes = PICTURE_SIDE as usize * PICTURE_SIDE as usize * 8;
    png::Decoder::new_with_limits(Cursor::new(png), png::Limits { bytes })
}

fn bad(error: png::DecodingError) -> Error {
    Error::BadPicture(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_ten_times_as_large_and_never_wraps() {
        let a = Picture::from_rgb(2, 1, &[10, 20, 30, 0, 255, 7]).unwrap();
        let b = Picture::from_rgb(2, 1, &[12, 19, 30, 255, 0, 7]).unwrap();
        let difference = Picture::difference(&a, &b).unwrap();
        assert_eq!(difference.rgb().unwrap(), [20, 10, 0, 255, 255, 0]);
        assert_eq!(
            difference,
            Picture::difference(&b, &a).unwrap(),
            "same bytes, whatever the order"
        );
        let other = Picture::from_rgb(1, 2, &[0; 6]).unwrap();
        assert!(
            Picture::difference(&a, &other)
                .unwrap_err()
                .to_string()
                .contains("2 x 1")
        );
    }

    #[test]
    fn what_is_no_png_or_too_large_is_refused() {
        assert!(matches!(
            Picture::from_png(b"GIF89a".to_vec()),
            Err(Error::BadPicture(_))
        ));
        assert!(matches!(
            Picture::from_png(vec![0; PICTURE_BYTES + 1]),
            Err(Error::TooLarge { .. })
        ));
        let wide = PICTURE_SIDE + 1;
        let error = Picture::from_rgb(wide, 1, &vec![0; 3 * wide as usize]).unwrap_err();
        assert!(error.to_string().contains("4097 x 1"), "{error}");
        assert!(matches!(Picture::from_rgb(2, 2, &[0; 3]), Err(Error::BadPicture(_))));
    }

    #[test]
    fn bytes_are_taken_over_only_if_they_are_the_right_ones() {
        let picture = Picture::from_rgb(1, 1, &[1, 2, 3]).unwrap();
        let png = picture.png().unwrap().to_vec();
        let mut bare = Picture { png: None, ..picture };
        assert!(!bare.fill(b"other") && bare.png().is_none());
        assert!(bare.fill(&png) && bare.png().is_some());
    }
}
