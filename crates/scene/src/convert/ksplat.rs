//! Files of mkkellogg's viewer (.ksplat), of level 0: single precision in one section, and no buckets.
use super::values::{opacity_byte, unit};
use crate::Gaussians;
use crate::convert::splat::kept_byte;
use crate::fields::rest_count;
use crate::ksplat::{HEADER, Level, SECTION, index};
use std::io::{self, Write};

/// What the least and the largest byte of a harmonic would stand for; level 0 has none.
const HARMONICS: [f32; 2] = [-1.5, 1.5];

/// Writes checked Gaussians, with harmonics up to `degree`.
pub(super) fn write(gaussians: &Gaussians, degree: usize, out: &mut dyn Write) -> io::Result<()> {
    // The caller has checked that there are no more.
    let count = gaussians.len() as u32;
    out.write_all(&header(count))?;
    out.write_all(&section(count, degree))?;
    (0..gaussians.len()).try_for_each(|i| out.write_all(&row(gaussians, i, degree)))
}

fn header(count: u32) -> Vec<u8> {
    let mut bytes = vec![0; HEADER];
    bytes[1] = 1;
    for (at, number) in [(4, 1), (8, 1), (12, count), (16, count)] {
        bytes[at..at + 4].copy_from_slice(&u32::to_le_bytes(number));
    }
    for (at, number) in [36, 40].into_iter().zip(HARMONICS) {
        bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn section(count: u32, degree: usize) -> Vec<u8> {
    let mut bytes = vec![0; SECTION];
    // Readers work the length out; the writers that are known leave what does not fit in 32 bits to its lower ones.
    let length = u64::from(count) * Level::Single.row(degree) as u64;
    for (at, number) in [(0, count), (4, count), (28, length as u32)] {
        bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
    }
    bytes[40] = degree as u8;
    bytes
}

/// Position, standard deviations, rotation w, x, y, z, colour, opacity and harmonics.
fn row(gaussians: &Gaussians, row: usize, degree: usize) -> Vec<u8> {
    let each = gaussians.sh.per_gaussian();
    let colour = &gaussians.sh.coefficients[row * each..(row + 1) * each];
    // The largest deviations are in single precision by force.
    let scales = gaussians.log_scales[row].map(|v| (f64::from(v).exp() as f32).min(f32::MAX));
    let turn = unit(gaussians.rotations[row]).map(|v| v as f32);
    let mut bytes: Vec<u8> = gaussians.positions[row]
        .into_iter()
        .chain(scales)
        .chain(turn)
        .flat_map(f32::to_le_bytes)
        .collect();
    bytes.extend([0, 1, 2].map(|channel| kept_byte(colour[channel])));
    bytes.push(opacity_byte(gaussians.opacity_logits[row]));
    let mut harmonics = vec![0.0; rest_count(degree)];
    for i in 0..harmonics.len() {
        harmonics[index(i)] = colour[3 + i];
    }
    bytes.extend(harmonics.into_iter().flat_map(f32::to_le_bytes));
    bytes
}
