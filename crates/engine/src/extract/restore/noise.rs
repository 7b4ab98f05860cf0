//! How much noise a picture has: what is left of its smoothest parts when everything that changes slowly is taken away.
//!
//! J. Immerkær, "Fast noise variance estimation" (Computer Vision and Image Understanding 64, 1996) averages over the whole
//! picture; here the smoothest tenth decides, as texture is no noise.
use rayon::prelude::*;

use crate::picture::Picture;

/// Side of the squares in pixels that are judged by themselves.
const SIDE: usize = 8;
/// Share of the squares that are smoother than the one that decides.
const SMOOTHEST: f32 = 0.1;
/// A mean absolute value of the mixed difference of pixels with independent normal noise, by the noise's deviation: four
/// pixels add up to twice the deviation, and the mean absolute value of a normal one is √(2/π) of that.
const MEAN_DIFFERENCE: f32 = 2.0 * 0.797_884_6;

/// Standard deviation of a picture's noise, in the units of its values; 0 of a picture that is smaller than a square. Where
/// values are cut at black or white it is about half of what it was.
pub(super) fn deviation(picture: &Picture) -> f32 {
    let (across, down) = (squares(picture.width), squares(picture.height));
    let mut found: Vec<f32> = (0..across * down)
        .into_par_iter()
        .map(|i| square(picture, i % across * SIDE, i / across * SIDE))
        .collect();
    if found.is_empty() {
        return 0.0;
    }
    let place = (SMOOTHEST * (found.len() - 1) as f32) as usize;
    *found.select_nth_unstable_by(place, f32::total_cmp).1 / MEAN_DIFFERENCE
}

/// Whole squares along a side, whose differences reach one pixel further.
fn squares(side: u32) -> usize {
    (side as usize).saturating_sub(1) / SIDE
}

/// The mean absolute mixed difference of a square, which is nothing where values change evenly along rows or columns.
fn square(picture: &Picture, left: usize, top: usize) -> f32 {
    let row = 3 * picture.width as usize;
    let rows = picture.pixels[top * row..].windows(2 * row).step_by(row).take(SIDE);
    let sum: f32 = rows
        .map(|two| {
            let (upper, lower) = (&two[3 * left..], &two[row + 3 * left..]);
            let mixed = |i: usize| (upper[i] - upper[i + 3] - lower[i] + lower[i + 3]).abs();
            (0..3 * SIDE).map(mixed).sum::<f32>()
        })
        .sum();
    sum / (3 * SIDE * SIDE) as f32
}
