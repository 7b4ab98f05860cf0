//! Photographs for tests, and what hides bits in them.
use image::{RgbImage, imageops};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::OnceLock;

/// Width and height of a crop.
const SIDE: u32 = 200;

/// Four crops of each photograph, which don't overlap; `None` (with a message) where the photographs are absent. In CI their
/// absence is a failure.
///
/// Large photographs are first made half or a third as wide, which takes most traces of JPEG away.
pub fn crops() -> Option<&'static [Vec<RgbImage>]> {
    static CROPS: OnceLock<Option<Vec<Vec<RgbImage>>>> = OnceLock::new();
    CROPS.get_or_init(load).as_deref()
}

fn load() -> Option<Vec<Vec<RgbImage>>> {
    let folder = std::env::var_os("GUARDSPLAT_IMAGES").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/images/photos"),
        PathBuf::from,
    );
    let Ok(entries) = std::fs::read_dir(&folder) else {
        assert!(
            std::env::var_os("CI").is_none(),
            "{} is missing; set GUARDSPLAT_IMAGES",
            folder.display()
        );
        eprintln!(
            "skipped: {} is missing; set GUARDSPLAT_IMAGES to run this test",
            folder.display()
        );
        return None;
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    Some(
        paths
            .par_iter()
            .map(|path| cut(&image::open(path).unwrap().to_rgb8()))
            .collect(),
    )
}

fn cut(photograph: &RgbImage) -> Vec<RgbImage> {
    let (width, height) = photograph.dimensions();
    let divisor = (1..=3).rev().find(|divisor| width.min(height) / divisor >= 2 * SIDE);
    let small = match divisor {
        Some(1) => photograph.clone(),
        Some(divisor) => imageops::thumbnail(photograph, width / divisor, height / divisor),
        None => imageops::thumbnail(photograph, 2 * SIDE, 2 * SIDE),
    };
    let places = [(0, 0), (1, 0), (0, 1), (1, 1)];
    // In the middle of each quarter.
    let (left, top) = (small.width() / 2 - SIDE, small.height() / 2 - SIDE);
    places
        .map(|(i, j)| {
            let x = left / 2 + i * (SIDE + left);
            let y = top / 2 + j * (SIDE + top);
            imageops::crop_imm(&small, x, y, SIDE, SIDE).to_image()
        })
        .to_vec()
}

/// LSB replacement: the last bit of a share `rate` of the samples becomes a random one.
pub fn lsb_replacement(picture: &RgbImage, rate: f64, seed: u64) -> RgbImage {
    super::control::replace_bits(picture, rate, seed)
}

/// LSB matching: a share `rate` of the samples gets a random last bit by adding or subtracting 1.
pub fn lsb_matching(picture: &RgbImage, rate: f64, seed: u64) -> RgbImage {
    change(picture, rate, seed, |sample, rng| {
        let (bit, up) = (rng.random::<bool>(), rng.random::<bool>());
        match sample {
            _ if (sample % 2 == 1) == bit => sample,
            0 => 1,
            255 => 254,
            _ if up => sample + 1,
            _ => sample - 1,
        }
    })
}

fn change(picture: &RgbImage, rate: f64, seed: u64, new: impl Fn(u8, &mut ChaCha8Rng) -> u8) -> RgbImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut changed = picture.clone();
    for sample in changed.iter_mut() {
        if rng.random_bool(rate) {
            *sample = new(*sample, &mut rng);
        }
    }
    changed
}

/// A picture of one value in all samples.
pub fn constant(width: u32, height: u32, value: u8) -> RgbImage {
    RgbImage::from_pixel(width, height, image::Rgb([value; 3]))
}

/// A picture of random samples.
pub fn noise(width: u32, height: u32, seed: u64) -> RgbImage {
    let mut picture = constant(width, height, 0);
    ChaCha8Rng::seed_from_u64(seed).fill_bytes(&mut picture);
    picture
}
