//! Filters over the neighbourhood of a pixel: blur, median, sharpening.
//!
//! The crate imageproc is not used: its Gaussian takes no size of the kernel, and treats edges otherwise than torchvision,
//! by which published numbers are measured.
use image::{Rgb, Rgb32FImage, RgbImage};

/// Normalised weights of a Gaussian of odd side `side`, with the σ that torchvision and OpenCV compute for it,
/// `0.3 ((side - 1) / 2 - 1) + 0.8`.
pub(super) fn gaussian(side: u32) -> Vec<f32> {
    let half = f64::from(side / 2);
    let sigma = 0.3 * (half - 1.0) + 0.8;
    let weight = |tap: u32| (-0.5 * ((f64::from(tap) - half) / sigma).powi(2)).exp();
    let sum: f64 = (0..side).map(weight).sum();
    (0..side).map(|tap| (weight(tap) / sum) as f32).collect()
}

/// Gaussian blur with an odd kernel, as torchvision's `gaussian_blur`, but rounded only once, after both directions.
pub(super) fn blur(picture: &RgbImage, side: u32) -> RgbImage {
    let (width, height) = picture.dimensions();
    let kernel = gaussian(side);
    let taps = || kernel.iter().zip(-i64::from(side / 2)..);
    let across = Rgb32FImage::from_fn(width, height, |x, y| {
        weighted(taps().map(|(weight, tap)| {
            let Rgb(values) = *picture.get_pixel(mirrored(i64::from(x) + tap, width), y);
            (*weight, values.map(f32::from))
        }))
    });
    RgbImage::from_fn(width, height, |x, y| {
        let Rgb(values) = weighted(taps().map(|(weight, tap)| {
            let Rgb(values) = *across.get_pixel(x, mirrored(i64::from(y) + tap, height));
            (*weight, values)
        }));
        Rgb(values.map(|value| value.round() as u8))
    })
}

fn weighted(pixels: impl Iterator<Item = (f32, [f32; 3])>) -> Rgb<f32> {
    pixels.fold(Rgb([0.0; 3]), |Rgb(sum), (weight, values)| {
        Rgb(std::array::from_fn(|channel| sum[channel] + weight * values[channel]))
    })
}

/// A position mirrored at the ends of `0..size`, which are not repeated, however far outside.
fn mirrored(position: i64, size: u32) -> u32 {
    let last = i64::from(size) - 1;
    if last == 0 {
        return 0;
    }
    let folded = position.rem_euclid(2 * last);
    // Below `size`, so it fits.
    folded.min(2 * last - folded) as u32
}

/// Median of each channel over an odd window; pixels of the edge are repeated.
pub(super) fn median(picture: &RgbImage, side: u32) -> RgbImage {
    let (width, height) = picture.dimensions();
    let half = side / 2;
    let near = |position: u32, size: u32| (0..side).map(move |tap| (position + tap).saturating_sub(half).min(size - 1));
    let mut window = Vec::new();
    RgbImage::from_fn(width, height, |x, y| {
        Rgb(std::array::from_fn(|channel| {
            window.clear();
            for row in near(y, height) {
                window.extend(near(x, width).map(|column| picture.get_pixel(column, row).0[channel]));
            }
            let middle = window.len() / 2;
            *window.select_nth_unstable(middle).1
        }))
    })
}

/// `smooth + factor · (picture - smooth)`, where smooth weighs a pixel 5 and its eight neighbours 1, of 13; the edge stays.
///
/// As torchvision's `adjust_sharpness` and Pillow's `ImageEnhance.Sharpness`, but rounded only once.
pub(super) fn sharpen(picture: &RgbImage, factor: f32) -> RgbImage {
    let (width, height) = picture.dimensions();
    RgbImage::from_fn(width, height, |x, y| {
        let pixel = *picture.get_pixel(x, y);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return pixel;
        }
        let around = (y - 1..=y + 1).flat_map(|row| (x - 1..=x + 1).map(move |column| (column, row)));
        let Rgb(smooth) = weighted(around.map(|(column, row)| {
            let weight = if (column, row) == (x, y) { 5.0 } else { 1.0 };
            (weight / 13.0, picture.get_pixel(column, row).0.map(f32::from))
        }));
        Rgb(std::array::from_fn(|channel| {
            let value = f32::from(pixel.0[channel]);
            (smooth[channel] + factor * (value - smooth[channel])).round() as u8
        }))
    })
}
