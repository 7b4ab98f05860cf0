//! Bytes of colour: the constant term as a colour that may leave 0 to 1 a little, the others in steps of 1/128.
//!
//! Computed in double precision, whose rounding is far below half a step, so that the nearest byte is found and every
//! byte comes back as itself.
use super::header::Header;
use crate::gaussians::Sh;

/// Bytes for each unit of the constant term: 255 for the whole range of colours, of which a unit is 0.15.
const CONSTANT: f64 = 0.15 * 255.0;
/// Bytes for each unit of the other terms.
pub(crate) const HARMONIC: f64 = 128.0;
/// The byte of a harmonic that is 0.
pub(crate) const ZERO: u8 = 128;

/// The constant term that a byte stands for.
pub(crate) fn constant(byte: u8) -> f32 {
    ((f64::from(byte) - 127.5) / CONSTANT) as f32
}

/// Any other term that a byte stands for.
pub(crate) fn harmonic(byte: u8) -> f32 {
    ((f64::from(byte) - f64::from(ZERO)) / HARMONIC) as f32
}

// Conversion to an integer truncates, which rounds what was moved up by half a step, and stays within 0 to 255.

/// The byte nearest to a constant term.
pub(crate) fn constant_byte(value: f32) -> u8 {
    (f64::from(value) * CONSTANT + 128.0) as u8
}

fn harmonic_byte(value: f32) -> u8 {
    (f64::from(value) * HARMONIC + f64::from(ZERO) + 0.5) as u8
}

/// Replaces the coefficients of one Gaussian by those that bytes stand for.
pub(super) fn quantize_colors(coefficients: &mut [f32]) {
    for (i, value) in coefficients.iter_mut().enumerate() {
        *value = if i < 3 {
            constant(constant_byte(*value))
        } else {
            harmonic(harmonic_byte(*value))
        };
    }
}

/// The section of colours for `sh`.
pub(super) fn constants(sh: &Sh) -> Vec<u8> {
    let rows = sh.coefficients.chunks_exact(sh.per_gaussian());
    rows.flat_map(|row| [row[0], row[1], row[2]].map(constant_byte))
        .collect()
}

/// The section of spherical harmonics for `sh`: that of the file with the bands that `sh` has replaced.
pub(super) fn harmonics(header: &Header, section: &[u8], sh: &Sh) -> Vec<u8> {
    let mut bytes = section.to_vec();
    let used = sh.per_gaussian() - 3;
    if used > 0 {
        let rows = bytes.chunks_exact_mut(header.harmonics_bytes());
        for (row, values) in rows.zip(sh.coefficients.chunks_exact(sh.per_gaussian())) {
            for (byte, value) in row.iter_mut().zip(&values[3..]) {
                *byte = harmonic_byte(*value);
            }
        }
    }
    bytes
}
