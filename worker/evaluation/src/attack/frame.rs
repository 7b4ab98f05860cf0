//! What is cut away around a picture, or put there.
use image::imageops::{crop_imm, replace};
use image::{Rgb, RgbImage};
use rand_chacha::ChaCha8Rng;

use super::draw::up_to;
use super::size::{check, share_of};
use crate::Result;

/// The centred window of a share of each side.
pub(super) fn crop(picture: &RgbImage, share: f64) -> RgbImage {
    centred(
        picture,
        share_of(picture.width(), share),
        share_of(picture.height(), share),
    )
}

/// The centred window of at most `most` pixels a side.
pub(super) fn window(picture: &RgbImage, most: u32) -> RgbImage {
    centred(picture, picture.width().min(most), picture.height().min(most))
}

/// A window of a share of each side, at a place that is uniform over those inside.
pub(super) fn crop_random(picture: &RgbImage, share: f64, random: &mut ChaCha8Rng) -> RgbImage {
    let (width, height) = (share_of(picture.width(), share), share_of(picture.height(), share));
    let left = up_to(random, picture.width().saturating_sub(width));
    let top = up_to(random, picture.height().saturating_sub(height));
    crop_imm(picture, left, top, width, height).to_image()
}

fn centred(picture: &RgbImage, width: u32, height: u32) -> RgbImage {
    let left = picture.width().saturating_sub(width) / 2;
    let top = picture.height().saturating_sub(height) / 2;
    crop_imm(picture, left, top, width, height).to_image()
}

/// A white frame as wide as a share of the shorter side, outside the picture.
pub(super) fn border(picture: &RgbImage, share: f64) -> Result<RgbImage> {
    let (width, height) = picture.dimensions();
    let frame = share_of(width.min(height), share);
    check((width + 2 * frame, height + 2 * frame))?;
    let mut framed = RgbImage::from_pixel(width + 2 * frame, height + 2 * frame, Rgb([255; 3]));
    replace(&mut framed, picture, frame.into(), frame.into());
    Ok(framed)
}
