//! Which pixels of a view show the scene, and how much a mark shows there.
use super::psnr::{Psnr, squared_error};
use crate::error::{Error, Result};
use crate::picture::Picture;

/// A pixel that hides at least so much of the background is covered.
pub(crate) const COVERED: f32 = 0.5;

/// For each pixel, row by row, whether the scene covers it: by one view over white and the same over black, between which
/// only what shows through differs.
///
/// # Errors
/// [`Error::BadOption`] for pictures of two sizes.
pub fn covered(white: &Picture, black: &Picture) -> Result<Vec<bool>> {
    if (white.width, white.height) != (black.width, black.height) {
        return Err(Error::BadOption {
            field: "pictures",
            reason: "a view has one size over every background".into(),
        });
    }
    let pixels = white.pixels.chunks_exact(3).zip(black.pixels.chunks_exact(3));
    let through = |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(a, b)| a - b).sum::<f32>() / 3.0;
    Ok(pixels.map(through).map(|through| through <= 1.0 - COVERED).collect())
}

/// PSNR over the covered pixels of a view; none where no pixel is.
///
/// # Errors
/// Those of [`psnr`](super::psnr()), and [`Error::BadOption`] where there are not as many pixels as in the mask.
pub fn psnr_covered(original: &Picture, marked: &Picture, covered: &[bool]) -> Result<Option<Psnr>> {
    let of = |picture: &Picture| Picture {
        width: picture.width,
        height: picture.height,
        pixels: (picture.pixels.chunks_exact(3).zip(covered))
            .filter(|(_, covered)| **covered)
            .flat_map(|(pixel, _)| pixel.iter().copied())
            .collect(),
    };
    if 3 * covered.len() != original.pixels.len() || original.pixels.len() != marked.pixels.len() {
        return Err(Error::BadOption {
            field: "pictures",
            reason: "sizes differ".into(),
        });
    }
    if !covered.contains(&true) {
        return Ok(None);
    }
    Ok(Some(squared_error(&of(original), &of(marked)).into()))
}

/// Share of pixels that are covered, 0 to 1.
pub fn share(covered: &[bool]) -> f64 {
    covered.iter().filter(|covered| **covered).count() as f64 / covered.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(pixels: [f32; 4]) -> Picture {
        Picture {
            width: 2,
            height: 2,
            pixels: pixels.into_iter().flat_map(|value| [value; 3]).collect(),
        }
    }

    #[test]
    fn what_shows_through_is_not_covered() {
        let found = covered(&picture([1.0, 0.5, 0.9, 0.4]), &picture([0.0, 0.5, 0.3, 0.0])).unwrap();
        assert_eq!(found, [false, true, false, true]);
        assert_eq!(share(&found), 0.5);
        let narrow = Picture {
            width: 4,
            height: 1,
            ..picture([0.0; 4])
        };
        assert!(covered(&narrow, &picture([0.0; 4])).is_err());
    }

    /// A change of a tenth in the one covered pixel of four: 20 dB there, 26 over all.
    #[test]
    fn what_is_not_covered_does_not_count() {
        let (a, b) = (picture([0.5; 4]), picture([0.6, 0.5, 0.5, 0.5]));
        let Some(Psnr::Decibel(db)) = psnr_covered(&a, &b, &[true, false, false, false]).unwrap() else {
            panic!()
        };
        assert!((db - 20.0).abs() < 1e-4, "{db}");
        assert_eq!(
            psnr_covered(&a, &b, &[false, true, true, true]).unwrap(),
            Some(Psnr::Identical)
        );
        assert_eq!(psnr_covered(&a, &b, &[false; 4]).unwrap(), None);
        assert!(psnr_covered(&a, &b, &[true; 3]).is_err());
    }
}
