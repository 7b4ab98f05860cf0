//! antimatter15's .splat: 32 bytes a Gaussian, the largest first, so that a viewer has them early.
use super::values::{byte, opacity, opacity_byte, unit};
use crate::Gaussians;
use crate::range::Range;
use crate::sniff::announced;
use crate::splat::ROW;
use std::io::{self, Write};

/// Rows by volume times opacity, the largest first, ties by row.
///
/// Nothing in a file says that it is a .splat, so that the first Gaussian must not begin like a file of another format
/// (one x in 65,000 would pass for an SPZ). One that does changes places with the next that does not; `Err` where there
/// is none.
pub(super) fn order(gaussians: &Gaussians) -> Result<Vec<usize>, String> {
    // Its logarithm: there may be volumes beyond all numbers of opacity 0.
    let size = |row: usize| {
        let volume: f64 = gaussians.log_scales[row].iter().map(|v| f64::from(*v)).sum();
        volume + opacity(gaussians.opacity_logits[row]).ln()
    };
    let sizes: Vec<f64> = (0..gaussians.len()).map(size).collect();
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by(|a, b| sizes[*b].total_cmp(&sizes[*a]));
    match order.iter().position(|i| announced(&row(gaussians, *i)).is_none()) {
        Some(place) => order.swap(0, place),
        None => return Err("Gaussians whose bytes would pass for another format than .splat".to_string()),
    }
    Ok(order)
}

/// Writes checked Gaussians in the order of `order`.
pub(super) fn write(gaussians: &Gaussians, order: &[usize], out: &mut dyn Write) -> io::Result<()> {
    order.iter().try_for_each(|i| out.write_all(&row(gaussians, *i)))
}

/// Position, standard deviations, colour, opacity and rotation w, x, y, z.
fn row(gaussians: &Gaussians, row: usize) -> [u8; ROW] {
    let start = row * gaussians.sh.per_gaussian();
    let mut bytes = [0; ROW];
    // The largest deviations are in single precision by force.
    let scales = gaussians.log_scales[row].map(|v| (f64::from(v).exp() as f32).min(f32::MAX));
    let floats = gaussians.positions[row].into_iter().chain(scales);
    let colour = (0..3).map(|channel| kept_byte(gaussians.sh.coefficients[start + channel]));
    let turn = unit(gaussians.rotations[row])
        .into_iter()
        .map(|v| byte(v * 128.0 + 128.0));
    let all = floats
        .flat_map(f32::to_le_bytes)
        .chain(colour)
        .chain([opacity_byte(gaussians.opacity_logits[row])])
        .chain(turn);
    bytes.iter_mut().zip(all).for_each(|(byte, new)| *byte = new);
    bytes
}

/// The byte of a constant coefficient.
pub(crate) fn kept_byte(coefficient: f32) -> u8 {
    Range::UNIT.nearest(coefficient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Format, Sh, sniff};

    fn scene(x: &[f32], log_scales: &[f32], logits: &[f32]) -> Gaussians {
        Gaussians {
            positions: x.iter().map(|x| [*x, 0.0, 0.0]).collect(),
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; x.len()],
            log_scales: log_scales.iter().map(|v| [*v; 3]).collect(),
            opacity_logits: logits.to_vec(),
            sh: Sh {
                degree: 0,
                coefficients: vec![0.0; 3 * x.len()],
            },
        }
    }

    #[test]
    fn the_largest_come_first() {
        let infinite = f32::INFINITY;
        let scene = scene(
            &[0.0; 6],
            &[-infinite, -1.0, -1.0, -0.9, 300.0, -1.0],
            &[infinite, 0.0, 1.0, -9.0, -infinite, 0.0],
        );
        assert_eq!(order(&scene).unwrap(), [2, 1, 5, 3, 0, 4]);
    }

    #[test]
    fn the_first_does_not_pass_for_another_format() {
        let gzip = f32::from_le_bytes([0x1f, 0x8b, 0x08, 0x40]);
        let two = scene(&[gzip, 2.0], &[0.0, -1.0], &[0.0, 0.0]);
        assert_eq!(order(&two).unwrap(), [1, 0]);
        let mut bytes = Vec::new();
        write(&two, &[1, 0], &mut bytes).unwrap();
        assert_eq!(sniff(&bytes, 64), Some(Format::Splat));
        assert!(order(&scene(&[gzip], &[0.0], &[0.0])).is_err());
    }
}
