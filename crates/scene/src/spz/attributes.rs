//! Sections of bytes to Gaussians. No byte is illegal: positions, scales and rotations are finite, and an opacity is
//! at most infinite.
use super::colour::{self, ZERO};
use super::header::Header;
use crate::gaussians::{Gaussians, Sh};
use std::f32::consts::FRAC_1_SQRT_2;

/// The Gaussians of the sections that `header` promises.
pub(super) fn decode(header: &Header, sections: [&[u8]; 6]) -> Gaussians {
    let [positions, alphas, colours, scales, rotations, harmonics] = sections;
    let step = (-f32::from(header.fractional_bits)).exp2();
    let rotation = if header.version == 2 {
        first_three
    } else {
        smallest_three
    };
    Gaussians {
        positions: triples(positions, 3, |bytes| position(bytes) * step),
        rotations: rotations.chunks_exact(header.rotation_bytes()).map(rotation).collect(),
        log_scales: triples(scales, 1, |bytes| f32::from(bytes[0]) / 16.0 - 10.0),
        opacity_logits: alphas.iter().map(|alpha| opacity_logit(*alpha)).collect(),
        sh: sh(header, colours, harmonics),
    }
}

/// Three numbers of `bytes` each, a Gaussian.
fn triples(section: &[u8], bytes: usize, number: impl Fn(&[u8]) -> f32) -> Vec<[f32; 3]> {
    let rows = section.chunks_exact(3 * bytes);
    rows.map(|row| std::array::from_fn(|i| number(&row[i * bytes..(i + 1) * bytes])))
        .collect()
}

/// A signed integer of 24 bits.
fn position(bytes: &[u8]) -> f32 {
    (i32::from_le_bytes([0, bytes[0], bytes[1], bytes[2]]) >> 8) as f32
}

/// The inverse of the sigmoid; infinite for the bytes of what is not there at all and what is fully opaque.
fn opacity_logit(alpha: u8) -> f32 {
    (f64::from(alpha) / f64::from(255 - alpha)).ln() as f32
}

/// Version 2: x, y and z of a unit quaternion whose w is not negative. Rounding makes some longer than 1; they stay so.
fn first_three(bytes: &[u8]) -> [f32; 4] {
    let [x, y, z] = std::array::from_fn(|i| (f32::from(bytes[i]) - 127.5) / 127.5);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    [w, x, y, z]
}

/// Since version 3: which of x, y, z and w is the largest, in two bits, and the others in that order with sign and
/// nine bits each, in units of 1/511 of the most that they can be.
fn smallest_three(bytes: &[u8]) -> [f32; 4] {
    let mut bits = super::header::word(bytes, 0);
    let largest = (bits >> 30) as usize;
    let mut xyzw = [0.0; 4];
    let mut squares = 0.0;
    for i in (0..4).rev().filter(|i| *i != largest) {
        let size = FRAC_1_SQRT_2 * (bits & 511) as f32 / 511.0;
        xyzw[i] = if bits & 512 == 0 { size } else { -size };
        squares += size * size;
        bits >>= 10;
    }
    // Bytes that no writer would write can have more than 1 left of the root.
    xyzw[largest] = (1.0_f32 - squares).max(0.0).sqrt();
    let [x, y, z, w] = xyzw;
    [w, x, y, z]
}

/// Colours of the bands that are used; padding with zeros is common, and those of it stay in the file.
fn sh(header: &Header, colours: &[u8], harmonics: &[u8]) -> Sh {
    let degree = used_degree(header, harmonics);
    let mut sh = Sh {
        degree,
        coefficients: Vec::new(),
    };
    let stored = header.harmonics_bytes();
    let used = sh.per_gaussian() - 3;
    sh.coefficients.reserve_exact(header.points * sh.per_gaussian());
    for (i, constants) in colours.chunks_exact(3).enumerate() {
        let row = &harmonics[i * stored..i * stored + used];
        sh.coefficients
            .extend(constants.iter().map(|byte| colour::constant(*byte)));
        sh.coefficients.extend(row.iter().map(|byte| colour::harmonic(*byte)));
    }
    sh
}

/// The highest band in which some Gaussian has a coefficient other than 0.
fn used_degree(header: &Header, harmonics: &[u8]) -> usize {
    let mut degree = 0;
    if header.degree == 0 {
        return degree;
    }
    for row in harmonics.chunks_exact(header.harmonics_bytes()) {
        if let Some(last) = row.iter().rposition(|byte| *byte != ZERO) {
            degree = degree.max((last / 3 + 1).isqrt());
        }
        if degree == header.degree {
            break;
        }
    }
    degree
}
