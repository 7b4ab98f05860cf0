//! Colours and tones: each pixel for itself, and the mean grey of the picture.
use image::{Rgb, RgbImage};

/// Values times `factor`.
pub(super) fn brightness(picture: RgbImage, factor: f64) -> RgbImage {
    by_table(picture, |value| value * factor)
}

/// The values of each channel times its factor.
pub(super) fn tint(picture: RgbImage, factors: [f64; 3]) -> RgbImage {
    by_pixel(picture, |pixel| {
        std::array::from_fn(|channel| f64::from(pixel.0[channel]) * factors[channel])
    })
}

/// Values times 1 - `missing` · r², r being the distance from the centre, 1 in the corners.
pub(super) fn vignette(mut picture: RgbImage, missing: f64) -> RgbImage {
    let (width, height) = (f64::from(picture.width()), f64::from(picture.height()));
    let from_middle = |i: u32, side: f64| f64::from(i) + 0.5 - 0.5 * side;
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let squared = from_middle(x, width).powi(2) + from_middle(y, height).powi(2);
        let factor = 1.0 - missing * squared / (0.25 * (width * width + height * height));
        pixel.0 = pixel
            .0
            .map(|value| (f64::from(value) * factor).round().clamp(0.0, 255.0) as u8);
    }
    picture
}

/// Distance from the mean grey times `factor`.
pub(super) fn contrast(picture: RgbImage, factor: f64) -> RgbImage {
    let sum: f64 = picture.pixels().map(luma).sum();
    let mean = sum / (f64::from(picture.width()) * f64::from(picture.height()));
    by_table(picture, |value| mean + factor * (value - mean))
}

/// Values of [0, 1] to the power of `exponent`.
pub(super) fn gamma(picture: RgbImage, exponent: f64) -> RgbImage {
    by_table(picture, |value| 255.0 * (value / 255.0).powf(exponent))
}

/// Black moved to `black`, of 1, and white kept.
pub(super) fn fade(picture: RgbImage, black: f64) -> RgbImage {
    by_table(picture, |value| 255.0 * black + (1.0 - black) * value)
}

/// Values bent by an S; black, white and the middle stay.
pub(super) fn curve(picture: RgbImage, bend: f64) -> RgbImage {
    use std::f64::consts::TAU;
    by_table(picture, |value| {
        value - 255.0 * bend * (TAU * value / 255.0).sin() / TAU
    })
}

/// Values rounded to 2^`bits` steps of equal distance from 0 to 255.
pub(super) fn bits(picture: RgbImage, bits: u32) -> RgbImage {
    let top = f64::from((1u32 << bits.min(8)) - 1);
    by_table(picture, |value| (value / 255.0 * top).round() / top * 255.0)
}

/// Distance from the grey of the pixel times `factor`; 0 leaves the grey.
pub(super) fn saturation(picture: RgbImage, factor: f64) -> RgbImage {
    by_pixel(picture, |pixel| {
        let grey = luma(pixel);
        pixel.0.map(|value| grey + factor * (f64::from(value) - grey))
    })
}

/// Hue of HSV shifted by a share of the circle of colours; saturation and value stay.
pub(super) fn hue(picture: RgbImage, turn: f64) -> RgbImage {
    by_pixel(picture, |pixel| turned(pixel.0.map(f64::from), turn))
}

fn turned([red, green, blue]: [f64; 3], turn: f64) -> [f64; 3] {
    let most = red.max(green).max(blue);
    let least = red.min(green).min(blue);
    let chroma = most - least;
    if chroma == 0.0 {
        return [red, green, blue];
    }
    // Sixths of the circle, from red over green and blue.
    let hue = if most == red {
        (green - blue) / chroma
    } else if most == green {
        2.0 + (blue - red) / chroma
    } else {
        4.0 + (red - green) / chroma
    };
    // A channel is 1 over a third of the circle around its colour, 0 over the opposite third, and linear in between.
    let channel = |shift: f64| {
        let distance = (hue + 6.0 * turn - shift + 3.0).rem_euclid(6.0) - 3.0;
        least + chroma * (2.0 - distance.abs()).clamp(0.0, 1.0)
    };
    [channel(0.0), channel(2.0), channel(4.0)]
}

/// Luma of ITU-R BT.601.
fn luma(pixel: &Rgb<u8>) -> f64 {
    let [red, green, blue] = pixel.0.map(f64::from);
    0.299 * red + 0.587 * green + 0.114 * blue
}

/// Clamps and rounds what a value of 0 to 255 becomes.
fn by_table(mut picture: RgbImage, tone: impl Fn(f64) -> f64) -> RgbImage {
    // The cast clamps.
    let table: [u8; 256] = std::array::from_fn(|value| tone(value as f64).round() as u8);
    picture.iter_mut().for_each(|value| *value = table[usize::from(*value)]);
    picture
}

/// Clamps and rounds what a pixel becomes.
fn by_pixel(mut picture: RgbImage, colour: impl Fn(&Rgb<u8>) -> [f64; 3]) -> RgbImage {
    picture
        .pixels_mut()
        .for_each(|pixel| pixel.0 = colour(pixel).map(|value| value.round() as u8));
    picture
}
