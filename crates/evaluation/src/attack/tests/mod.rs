//! Tests of attacks.
use image::{Rgb, RgbImage};

use super::Attack;

mod codecs;
mod properties;
mod random;
mod shapes;
mod suites;
mod text;
mod values;

fn attack(text: &str) -> Attack {
    text.parse().unwrap()
}

/// What an attack makes of a picture with seed 1 and index 0.
fn done(text: &str, picture: &RgbImage) -> RgbImage {
    attack(text).apply(picture, 1, 0).unwrap()
}

/// A small picture in which no two pixels are alike, nor any channels.
fn varied(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        Rgb([
            (x * 17 % 251) as u8,
            (y * 23 % 253) as u8,
            ((x * 7 + y * 13) % 255) as u8,
        ])
    })
}

/// A row of grey pixels.
fn row(values: &[u8]) -> RgbImage {
    RgbImage::from_fn(values.len() as u32, 1, |x, _| Rgb([values[x as usize]; 3]))
}

/// The grey pixels of a picture.
fn greys(picture: &RgbImage) -> Vec<u8> {
    picture.pixels().map(|pixel| pixel.0[0]).collect()
}
