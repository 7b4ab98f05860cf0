//! Niantic's SPZ of version 3: fixed point and bytes, a section an attribute, in one gzip stream.
use super::values::{byte, opacity_byte, smallest_three, unit};
use crate::Gaussians;
use crate::spz::colour::{HARMONIC, ZERO, constant_byte};
use crate::spz::header::{HEADER, MAGIC};
use crate::spz::limits;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{self, Write};

/// The last version that is a gzip stream, which every reader knows; the first with rotations of 32 bits.
const VERSION: u32 = 3;
/// Binary digits of a coordinate after its point, as the reference implementation has them.
const FRACTIONAL_BITS: u8 = 12;
/// Largest of the signed integers of 24 bits that coordinates are.
pub(super) const LARGEST: u32 = (1 << 23) - 1;
/// Bits of a harmonic of the first band, and of those above it; the reference implementation's defaults.
const BITS: [u32; 2] = [5, 4];
/// Harmonics of the first band, all channels.
const FIRST_BAND: usize = 9;

/// The file of checked Gaussians, rows as they are; `Err` is the reason for which it could not be read.
pub(super) fn encode(gaussians: &Gaussians) -> Result<Vec<u8>, String> {
    let content = content(gaussians);
    let promised = (content.len() - HEADER) as u64;
    let file = compress(&content).map_err(|e| format!("the gzip stream cannot be written: {e}"))?;
    limits::check(promised, file.len() as u64)
        .map_err(|reason| format!("Gaussians so much alike that no reader would take the file: {reason}"))?;
    Ok(file)
}

fn compress(content: &[u8]) -> io::Result<Vec<u8>> {
    // Without a name and a time in it, and on the level that the reference implementation uses.
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content)?;
    encoder.finish()
}

/// Header and sections.
fn content(gaussians: &Gaussians) -> Vec<u8> {
    let sh = &gaussians.sh;
    let fractional_bits = fractional_bits(&gaussians.positions);
    let mut content = Vec::with_capacity(HEADER + gaussians.len() * (17 + sh.per_gaussian()));
    content.extend(MAGIC);
    content.extend(VERSION.to_le_bytes());
    content.extend((gaussians.len() as u32).to_le_bytes());
    // Without flags; the last byte is reserved.
    content.extend([sh.degree as u8, fractional_bits, 0, 0]);
    let unit_steps = f64::from(1u32 << fractional_bits);
    for coordinate in gaussians.positions.as_flattened() {
        let [a, b, c, _] = ((f64::from(*coordinate) * unit_steps).round() as i32).to_le_bytes();
        content.extend([a, b, c]);
    }
    content.extend(gaussians.opacity_logits.iter().map(|logit| opacity_byte(*logit)));
    let rows = || sh.coefficients.chunks_exact(sh.per_gaussian());
    content.extend(rows().flat_map(|row| [row[0], row[1], row[2]].map(constant_byte)));
    let scales = gaussians.log_scales.as_flattened();
    content.extend(scales.iter().map(|v| byte((f64::from(*v) + 10.0) * 16.0)));
    content.extend(gaussians.rotations.iter().flat_map(|q| rotation(*q).to_le_bytes()));
    content.extend(rows().flat_map(|row| row[3..].iter().enumerate().map(|(i, v)| harmonic_byte(i, *v))));
    content
}

/// Digits after the point: 12, or as many as the largest coordinate leaves.
fn fractional_bits(positions: &[[f32; 3]]) -> u8 {
    let largest = positions
        .as_flattened()
        .iter()
        .fold(0.0f32, |most, v| most.max(v.abs()));
    let fits = |bits: &u8| (f64::from(largest) * f64::from(1u32 << bits)).round() <= f64::from(LARGEST);
    (0..=FRACTIONAL_BITS).rev().find(fits).unwrap_or(0)
}

/// Which of x, y, z and w is the largest, in two bits, and the others in that order with sign and nine bits each, in
/// units of 1/511 of sqrt(1/2).
fn rotation([w, x, y, z]: [f32; 4]) -> u32 {
    let [w, x, y, z] = unit([w, x, y, z]);
    let (largest, others) = smallest_three([x, y, z, w]);
    others.iter().fold(largest as u32, |word, v| {
        let size = ((v.abs() * std::f64::consts::SQRT_2 * 511.0).round() as u32).min(511);
        word << 10 | u32::from(*v < 0.0 && size > 0) << 9 | size
    })
}

/// The byte of harmonic `i` of a Gaussian, all channels counted: the nearest of 1/128, and of these the middle of the
/// bucket that it falls into. That of 0 is the middle of one.
pub(crate) fn harmonic_byte(i: usize, value: f32) -> u8 {
    let bucket = 1 << (8 - BITS[usize::from(i >= FIRST_BAND)]);
    // Far beyond the bytes, and small enough for integers.
    let steps = (f64::from(value) * HARMONIC).round().clamp(-1e6, 1e6) as i32 + i32::from(ZERO);
    ((steps + bucket / 2) / bucket * bucket).clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the formula of the reference implementation: round(128 v) + 128, then to multiples of 8 or 16.
    #[test]
    fn harmonics_are_in_buckets() {
        for (i, value, expected) in [
            (0, 0.0, 128),
            (0, 0.027, 128),   // 3.46
            (0, 0.028, 136),   // 3.58 rounds to 4, half a bucket
            (8, -0.0352, 120), // -4.51 rounds to -5: 123 + 4 = 127 -> 120
            (8, -0.035, 128),  // -4.48 rounds to -4: 124 + 4 = 128
            (9, 0.0545, 128),  // 6.98
            (9, 0.0586, 144),  // 7.5 rounds to 8
            (9, -0.1, 112),    // -12.8
            (44, 0.99, 255),   // 255 -> 256, cut off
            (0, 7.0, 255),
            (0, -7.0, 0),
            (0, f32::MAX, 255),
            (9, f32::MIN, 0),
        ] {
            assert_eq!(harmonic_byte(i, value), expected, "harmonic {i} of {value}");
        }
    }

    #[test]
    fn positions_have_as_many_digits_as_fit() {
        for (largest, bits) in [
            (0.0, 12),
            (2047.9, 12),
            (-2048.0, 11),
            (4095.0, 11),
            (1e6, 3),
            (8_388_607.0, 0),
        ] {
            assert_eq!(fractional_bits(&[[0.0; 3], [1.0, largest, 0.0]]), bits, "{largest}");
        }
        assert_eq!(fractional_bits(&[]), 12);
    }

    #[test]
    fn rotations_are_smallest_three_of_x_y_z_w() {
        assert_eq!(rotation([-1.0, 0.0, 0.0, 0.0]), 3 << 30, "w is the last");
        let half = 0.5f32.sqrt();
        assert_eq!(rotation([half, half, 0.0, 0.0]), 511, "x is the first of equals");
        assert_eq!(rotation([-half, half * 1.001, 0.0, 0.0]) & 512, 512);
        assert_eq!(rotation([0.0, 0.0, -1.0, 0.0]), 1 << 30, "no sign of 0");
    }
}
