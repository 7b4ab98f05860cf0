//! What is measured of a picture: SPAM features of its colours, of the differences between colours, and of half its size.
//!
//! Marks in the colours of Gaussians are wider than a pixel and differ between the channels. So besides the channels
//! themselves there are their differences, after Goljan, Fridrich, Cogranne, "Rich model for steganalysis of color images"
//! (WIFS 2014), and a picture of half the width and height.
use super::spam::{self, Plane};
use image::RgbImage;

/// Number of features.
#[cfg(test)]
pub(super) const FEATURES: usize = 3 * spam::FEATURES;

/// The features of a picture, each in `[0, 1]`.
pub(super) fn of(picture: &RgbImage) -> Vec<f64> {
    let colours = [0, 1, 2].map(|channel| plane(picture, |pixel| pixel[channel]));
    let differences = [0, 2].map(|channel| plane(picture, |pixel| pixel[channel] - pixel[1]));
    let halves: Vec<Plane> = colours.iter().map(half).collect();
    let mut features = spam::features(&colours);
    features.extend(spam::features(&differences));
    features.extend(spam::features(&halves));
    features
}

fn plane(picture: &RgbImage, value: impl Fn([i16; 3]) -> i16) -> Plane {
    Plane {
        width: picture.width() as usize,
        values: picture.pixels().map(|pixel| value(pixel.0.map(i16::from))).collect(),
    }
}

/// Means of squares of 2 by 2, rounded; an odd last row or column is left out.
fn half(plane: &Plane) -> Plane {
    if plane.width == 0 {
        return Plane {
            width: 0,
            values: Vec::new(),
        };
    }
    let mut values = Vec::with_capacity(plane.values.len() / 4);
    for rows in plane.values.chunks_exact(2 * plane.width) {
        let (above, below) = rows.split_at(plane.width);
        for (above, below) in above.chunks_exact(2).zip(below.chunks_exact(2)) {
            let sum: i16 = above.iter().chain(below).sum();
            values.push((sum + 2) >> 2);
        }
    }
    Plane {
        width: plane.width / 2,
        values,
    }
}
