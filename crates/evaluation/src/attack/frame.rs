//! What is cut away around a picture, or put there.
use image::imageops::{crop_imm, replace};
use image::{Rgb, RgbImage};
use rand::RngExt;
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

/// Boxes along each side of a page.
const BOXES: u32 = 12;

/// A page at a random place of which the picture is, as a share of its sides. The rest is white with boxes of random
/// colours, two in three of a grid: what else a screenshot shows.
pub(super) fn page(picture: &RgbImage, share: f64, random: &mut ChaCha8Rng) -> Result<RgbImage> {
    let sides = [picture.width(), picture.height()].map(|side| share_of(side, 1.0 / share));
    let [width, height] = sides;
    check((width, height))?;
    let left = up_to(random, width.saturating_sub(picture.width()));
    let top = up_to(random, height.saturating_sub(picture.height()));
    let mut page = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    let [wide, high] = sides.map(|side| side.div_ceil(BOXES));
    for (row, column) in (0..BOXES).flat_map(|row| (0..BOXES).map(move |column| (row, column))) {
        // Drawn for every place, so that the size of a page does not move its boxes.
        let (there, colour) = (random.random_range(0..3) > 0, random.random::<[u8; 3]>());
        if there {
            let filled = RgbImage::from_pixel((wide * 3 / 4).max(1), (high * 3 / 4).max(1), Rgb(colour));
            replace(&mut page, &filled, (column * wide).into(), (row * high).into());
        }
    }
    replace(&mut page, picture, left.into(), top.into());
    Ok(page)
}
