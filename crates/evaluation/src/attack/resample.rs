//! Other sizes: scaled, scaled and back, fitted into a box.
//!
//! Bilinear with a triangle that widens as the picture shrinks, that is, antialiased, as Pillow's `BILINEAR` and
//! torchvision's `resize`; the corners of both grids coincide, not the centres of their first pixels.
use image::RgbImage;
use image::imageops::{FilterType, resize};

use super::size::{check, share_of};
use crate::Result;

/// To a share of both sides.
pub(super) fn scale(picture: &RgbImage, share: f64) -> Result<RgbImage> {
    to(
        picture,
        share_of(picture.width(), share),
        share_of(picture.height(), share),
    )
}

/// To a share of both sides, and back to the size that it had.
pub(super) fn rescale(picture: &RgbImage, share: f64) -> Result<RgbImage> {
    to(&scale(picture, share)?, picture.width(), picture.height())
}

/// Until the longer side has `longest` pixels; smaller pictures stay.
pub(super) fn fit(picture: RgbImage, longest: u32) -> Result<RgbImage> {
    let longer = picture.width().max(picture.height());
    if longer <= longest {
        return Ok(picture);
    }
    scale(&picture, f64::from(longest) / f64::from(longer))
}

fn to(picture: &RgbImage, width: u32, height: u32) -> Result<RgbImage> {
    check((width, height))?;
    Ok(resize(picture, width, height, FilterType::Triangle))
}
