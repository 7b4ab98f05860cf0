//! Pictures for the eye: what the mark changed, and original, marked and difference side by side.
use crate::error::{Error, Result};
use crate::picture::Picture;

/// How much differences are enlarged.
pub const GAIN: f32 = 10.0;
/// Pixels between pictures of a sheet.
const GAP: usize = 4;

fn same_size(a: &Picture, b: &Picture) -> Result<()> {
    let size = |p: &Picture| (p.width, p.height, p.pixels.len());
    if size(a) == size(b) && a.pixels.len() == 3 * a.width as usize * a.height as usize {
        return Ok(());
    }
    Err(Error::BadOption {
        field: "pictures",
        reason: format!("sizes differ: {:?} and {:?}", size(a), size(b)),
    })
}

/// `10 |marked - original|` a channel, clamped to [0, 1]: black is unchanged, as in the watermarking literature.
/// Fails when sizes differ.
pub fn difference(original: &Picture, marked: &Picture) -> Result<Picture> {
    same_size(original, marked)?;
    let pixels = original
        .pixels
        .iter()
        .zip(&marked.pixels)
        .map(|(a, b)| (GAIN * (b - a).abs()).clamp(0.0, 1.0));
    Ok(Picture {
        pixels: pixels.collect(),
        ..*original
    })
}

/// One row a pair: original, marked and [`difference`], with grey gaps. All pictures must be of one size.
pub fn contact_sheet(pairs: &[(Picture, Picture)]) -> Result<Picture> {
    let Some((first, _)) = pairs.first() else {
        return Err(Error::BadOption {
            field: "pictures",
            reason: "there are none".into(),
        });
    };
    let (w, h) = (first.width as usize, first.height as usize);
    let (width, height) = (3 * w + 2 * GAP, pairs.len() * (h + GAP) - GAP);
    if width * height > super::files::MAX_PIXELS as usize {
        let reason = format!("a sheet of {width} x {height} pixels is too large; take fewer or smaller ones");
        return Err(Error::BadOption {
            field: "pictures",
            reason,
        });
    }
    let mut sheet = Picture {
        width: width as u32,
        height: height as u32,
        pixels: vec![0.5; width * height * 3],
    };
    for (row, (original, marked)) in pairs.iter().enumerate() {
        same_size(first, original)?;
        let difference = difference(original, marked)?;
        for (column, picture) in [original, marked, &difference].into_iter().enumerate() {
            for (y, line) in picture.pixels.chunks_exact(3 * w).enumerate() {
                let start = ((row * (h + GAP) + y) * width + column * (w + GAP)) * 3;
                sheet.pixels[start..start + 3 * w].copy_from_slice(line);
            }
        }
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: f32) -> Picture {
        Picture {
            width: 2,
            height: 3,
            pixels: vec![value; 18],
        }
    }

    #[test]
    fn differences_are_ten_times_as_large_and_clamped() {
        let (mut a, b) = (picture(0.5), picture(0.52));
        a.pixels[0] = 0.9;
        a.pixels[1] = 0.52;
        let d = difference(&a, &b).unwrap();
        assert_eq!((d.pixels[0], d.pixels[1]), (1.0, 0.0));
        assert!((d.pixels[2] - 0.2).abs() < 1e-5);
    }

    #[test]
    fn a_sheet_shows_three_pictures_a_row() {
        let sheet = contact_sheet(&[(picture(0.1), picture(0.12)), (picture(0.8), picture(0.8))]).unwrap();
        assert_eq!((sheet.width, sheet.height, sheet.pixels.len()), (14, 10, 420));
        let at = |x: usize, y: usize| sheet.pixels[(y * 14 + x) * 3];
        assert_eq!((at(0, 0), at(7, 2), at(2, 0), at(0, 3)), (0.1, 0.12, 0.5, 0.5));
        assert!((at(13, 1) - 0.2).abs() < 1e-5);
        assert_eq!((at(0, 7), at(13, 9)), (0.8, 0.0));
    }

    #[test]
    fn bad_input_is_refused() {
        let wide = Picture {
            width: 3,
            height: 2,
            pixels: vec![0.0; 18],
        };
        assert!(difference(&picture(0.0), &wide).is_err());
        assert!(contact_sheet(&[]).is_err());
        assert!(contact_sheet(&[(picture(0.0), picture(0.0)), (wide.clone(), wide)]).is_err());
    }
}
