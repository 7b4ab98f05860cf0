//! From pixels to Gaussians, by the formulas that PlayCanvas published.
use super::codebook::Codebook;
use super::palette::Palette;
use super::picture::Picture;
use crate::gaussians::Sh;
use crate::ignored::RowFilter;
use std::f64::consts::SQRT_2;

/// The first three values of the alpha of rotations are no component's.
pub(crate) const FIRST_COMPONENT: u8 = 252;

/// What a Gaussian needs in memory besides pictures.
pub(crate) fn bytes_per_gaussian(degree: usize) -> u64 {
    let numbers = 11 + 3 * (degree + 1) * (degree + 1);
    4 * numbers as u64
}

/// Centres: 16 bits a coordinate between the least and the largest of sign(x) ln(1 + |x|).
pub(super) fn positions(lower: &Picture, upper: &Picture, ranges: &[(f64, f64); 3], count: usize) -> Vec<[f32; 3]> {
    let position = |row| {
        let (lower, upper) = (lower.texel(row), upper.texel(row));
        std::array::from_fn(|i| {
            let (min, max) = ranges[i];
            let step = f64::from(u16::from_le_bytes([lower[i], upper[i]]));
            let log = min + (max - min) * (step / 65535.0);
            (log.abs().exp_m1() * log.signum()) as f32
        })
    };
    (0..count).map(position).collect()
}

/// Quaternions: alpha says which component was the largest, the others are in red, green and blue.
pub(super) fn rotations(picture: &Picture, count: usize, sieve: &mut RowFilter) -> Result<Vec<[f32; 4]>, String> {
    let rotation = |row| {
        let texel = picture.texel(row);
        let Some(largest) = texel[3].checked_sub(FIRST_COMPONENT) else {
            let reason = || format!("row {row} of quats has an alpha of {}, must be 252 to 255", texel[3]);
            return sieve.reject(row, reason).map(|()| [0.0; 4]);
        };
        let mut stored = texel[..3].iter().map(|byte| (f64::from(*byte) / 127.5 - 1.0) / SQRT_2);
        let mut quaternion = [0.0; 4];
        let mut squares = 0.0;
        for (i, component) in quaternion.iter_mut().enumerate() {
            if i != usize::from(largest) {
                let value = stored.next().unwrap_or_default();
                squares += value * value;
                *component = value as f32;
            }
        }
        quaternion[usize::from(largest)] = (1.0f64 - squares).max(0.0).sqrt() as f32;
        Ok(quaternion)
    };
    (0..count).map(rotation).collect()
}

/// Log scales: an index a coordinate.
pub(super) fn log_scales(
    picture: &Picture,
    tables: &[Codebook; 3],
    count: usize,
    sieve: &mut RowFilter,
) -> Result<Vec<[f32; 3]>, String> {
    (0..count)
        .map(|row| look_up(picture.texel(row), tables, "scales", row, sieve))
        .collect()
}

/// Opacity: the alpha of colours.
pub(super) fn opacity_logits(colours: &Picture, table: &Codebook, count: usize) -> Vec<f32> {
    (0..count).map(|row| table.value(colours.texel(row)[3])).collect()
}

/// Constant colours, an index a channel, and higher bands from the palette.
pub(super) fn sh(
    colours: &Picture,
    tables: &[Codebook; 3],
    palette: Option<&Palette>,
    count: usize,
    sieve: &mut RowFilter,
) -> Result<Sh, String> {
    let mut sh = Sh {
        degree: palette.map_or(0, Palette::degree),
        coefficients: Vec::new(),
    };
    sh.coefficients.reserve_exact(count * sh.per_gaussian());
    for row in 0..count {
        sh.coefficients
            .extend(look_up(colours.texel(row), tables, "sh0", row, sieve)?);
        if let Some(palette) = palette {
            sh.coefficients.extend(palette.row(row));
        }
    }
    Ok(sh)
}

/// The numbers that red, green and blue stand for; zeros where the row is sorted out.
fn look_up(
    texel: [u8; 4],
    tables: &[Codebook; 3],
    name: &str,
    row: usize,
    sieve: &mut RowFilter,
) -> Result<[f32; 3], String> {
    let values = std::array::from_fn(|i| tables[i].value(texel[i]));
    match values.iter().position(|value: &f32| value.is_nan()) {
        None => Ok(values),
        Some(i) => {
            let index = texel[i];
            let reason = || format!("row {row} of {name} has index {index}, which {name}.codebook has no number for");
            sieve.reject(row, reason).map(|()| [0.0; 3])
        }
    }
}
