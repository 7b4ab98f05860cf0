//! What an editor of scenes does to a copy: a part cut out, floaters taken away, another order, another place.
use super::{check, refused, without};
use crate::gltf::{Placement, Turn};
use crate::{Gaussians, Result, Sh};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::HashMap;

/// Leaves out the Gaussians whose centre is outside of the box from `least` to `largest`, its faces being inside.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): a corner that is no number, arrays of different lengths.
pub fn crop(gaussians: &Gaussians, least: [f32; 3], largest: [f32; 3]) -> Result<Gaussians> {
    check(gaussians)?;
    if least.iter().chain(&largest).any(|v| v.is_nan()) {
        return Err(refused(format!("a box from {least:?} to {largest:?}, must be numbers")));
    }
    let outside = |p: &[f32; 3]| (0..3).any(|i| p[i] < least[i] || p[i] > largest[i]);
    Ok(without(
        gaussians,
        &rows_where(gaussians, |row| outside(&gaussians.positions[row])),
    ))
}

/// Leaves out Gaussians that are nearly alone: with fewer than `neighbours` others in the cubes around theirs, the side of
/// a cube being the 64th part of that of the middle nine tenths of the scene.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): arrays of different lengths.
pub fn without_floaters(gaussians: &Gaussians, neighbours: usize) -> Result<Gaussians> {
    check(gaussians)?;
    let side = (0..3).map(|axis| width(gaussians, axis)).fold(0.0, f32::max) / 64.0;
    if side <= 0.0 {
        return Ok(gaussians.clone());
    }
    // Whatever is beyond the integers is alone there.
    let cell = |p: &[f32; 3]| p.map(|v| (v / side).floor() as i32);
    let mut counts: HashMap<[i32; 3], usize> = HashMap::new();
    for position in &gaussians.positions {
        *counts.entry(cell(position)).or_default() += 1;
    }
    let around = |place: [i32; 3]| -> usize {
        // There is nothing beyond the integers, where cubes would be counted twice.
        let places = (0..27).filter_map(|i| {
            let [x, y, z] = place;
            Some([
                x.checked_add(i % 3 - 1)?,
                y.checked_add(i / 3 % 3 - 1)?,
                z.checked_add(i / 9 - 1)?,
            ])
        });
        places.map(|place| counts.get(&place).copied().unwrap_or(0)).sum()
    };
    let alone = |row: usize| around(cell(&gaussians.positions[row])) <= neighbours;
    Ok(without(gaussians, &rows_where(gaussians, alone)))
}

/// How far the middle nine tenths of the centres reach along an axis.
fn width(gaussians: &Gaussians, axis: usize) -> f32 {
    let mut all: Vec<f32> = gaussians.positions.iter().map(|p| p[axis]).collect();
    all.sort_by(f32::total_cmp);
    match all.len() {
        0 => 0.0,
        n => all[(n - 1) - n / 20] - all[n / 20],
    }
}

fn rows_where(gaussians: &Gaussians, which: impl Fn(usize) -> bool) -> Vec<usize> {
    (0..gaussians.len()).filter(|row| which(*row)).collect()
}

/// The same Gaussians in a random order.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): arrays of different lengths.
pub fn shuffled(gaussians: &Gaussians, seed: u64) -> Result<Gaussians> {
    check(gaussians)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut keys: Vec<(u64, usize)> = (0..gaussians.len()).map(|row| (random.random(), row)).collect();
    keys.sort_unstable();
    let order = || keys.iter().map(|(_, row)| *row);
    let each = gaussians.sh.per_gaussian();
    Ok(Gaussians {
        positions: order().map(|row| gaussians.positions[row]).collect(),
        rotations: order().map(|row| gaussians.rotations[row]).collect(),
        log_scales: order().map(|row| gaussians.log_scales[row]).collect(),
        opacity_logits: order().map(|row| gaussians.opacity_logits[row]).collect(),
        sh: Sh {
            degree: gaussians.sh.degree,
            coefficients: order()
                .flat_map(|row| &gaussians.sh.coefficients[row * each..(row + 1) * each])
                .copied()
                .collect(),
        },
    })
}

/// Where a whole scene goes: turned, then scaled, then shifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Quaternion w, x, y, z of any length but 0.
    pub rotation: [f32; 4],
    /// More than 0.
    pub scale: f32,
    /// In units of the scene after it is scaled.
    pub shift: [f32; 3],
}

/// Moves a scene as a whole; its spherical harmonics turn along, so that it looks the same from cameras that move too.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): numbers that are not finite, a rotation of length 0, a scale that is not
/// more than 0, arrays of different lengths.
pub fn moved(gaussians: &Gaussians, motion: Motion) -> Result<Gaussians> {
    check(gaussians)?;
    let placement = Placement::of(motion.rotation, motion.scale, motion.shift)
        .ok_or_else(|| refused(format!("{motion:?}: must be finite, turn, and scale by more than 0")))?;
    let mut all = gaussians.clone();
    for position in &mut all.positions {
        *position = placement.position(*position);
    }
    for rotation in &mut all.rotations {
        *rotation = placement.rotation(*rotation);
    }
    for log in all.log_scales.as_flattened_mut() {
        *log = placement.log_scale(f64::from(*log));
    }
    if let Some(turn) = placement.turn() {
        turn_all(&mut all.sh, &turn);
    }
    Ok(all)
}

fn turn_all(sh: &mut Sh, turn: &Turn) {
    let (degree, each) = (sh.degree, sh.per_gaussian());
    for row in sh.coefficients.chunks_exact_mut(each) {
        for band in 1..=degree {
            turn.to_world(band, &mut row[3 * band * band..3 * (band + 1) * (band + 1)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::tests::random;

    fn at(positions: &[[f32; 3]]) -> Gaussians {
        let mut scene = random(positions.len(), 1, 1);
        scene.positions = positions.to_vec();
        scene
    }

    #[test]
    fn a_box_is_cut_out() {
        let scene = at(&[[0.0; 3], [1.0, 0.0, 0.0], [1.1, 0.0, 0.0], [0.5, -2.0, 0.0]]);
        let part = crop(&scene, [0.0; 3], [1.0; 3]).unwrap();
        assert_eq!(part.positions, scene.positions[..2]);
        assert_eq!(part.sh.coefficients, scene.sh.coefficients[..24]);
        assert!(crop(&scene, [f32::NAN; 3], [1.0; 3]).is_err());
    }

    #[test]
    fn what_is_alone_goes() {
        let mut places: Vec<[f32; 3]> = (0..4000)
            .map(|i| [(i % 20) as f32, (i / 20 % 20) as f32, (i / 400) as f32])
            .collect();
        places.extend([[900.0, 0.0, 0.0], [0.0, -3e9, 0.0]]);
        // Cubes of 17 / 64 have one each, and none beside them.
        assert!(without_floaters(&at(&places), 1).unwrap().is_empty());
        let dense: Vec<[f32; 3]> = places
            .iter()
            .map(|p| p.map(|v| if v.abs() < 30.0 { v / 100.0 } else { v }))
            .collect();
        let half: Vec<[f32; 3]> = dense.iter().chain(&dense[..4000]).copied().collect();
        assert_eq!(without_floaters(&at(&half), 1).unwrap().len(), 8000);
        assert!(without_floaters(&at(&[]), 3).unwrap().is_empty());
    }

    #[test]
    fn rows_stay_together_in_any_order() {
        let scene = random(200, 2, 3);
        let other = shuffled(&scene, 7).unwrap();
        assert_ne!(other.positions, scene.positions);
        for (row, position) in other.positions.iter().enumerate() {
            let old = scene.positions.iter().position(|p| p == position).unwrap();
            assert_eq!(other.opacity_logits[row], scene.opacity_logits[old]);
            assert_eq!(
                other.sh.coefficients[27 * row..][..27],
                scene.sh.coefficients[27 * old..][..27]
            );
        }
    }

    #[test]
    fn a_scene_moves_there_and_back() {
        let scene = random(100, 3, 4);
        // A quarter about z takes x to y.
        let there = Motion {
            rotation: [2.0, 0.0, 0.0, 2.0],
            scale: 3.0,
            shift: [1.0, 2.0, 3.0],
        };
        let moved_scene = moved(&scene, there).unwrap();
        let [x, y, z] = scene.positions[5];
        for (found, expected) in moved_scene.positions[5]
            .into_iter()
            .zip([1.0 - 3.0 * y, 2.0 + 3.0 * x, 3.0 + 3.0 * z])
        {
            assert!((found - expected).abs() < 1e-4);
        }
        let back = Motion {
            rotation: [1.0, 0.0, 0.0, -1.0],
            scale: 1.0 / 3.0,
            shift: [-2.0 / 3.0, 1.0 / 3.0, -1.0],
        };
        let again = moved(&moved_scene, back).unwrap();
        let near = |a: &[f32], b: &[f32]| {
            a.iter()
                .zip(b)
                .all(|(a, b)| a == b || (a - b).abs() < 1e-4 * b.abs().max(1.0))
        };
        assert!(near(again.positions.as_flattened(), scene.positions.as_flattened()));
        assert!(near(again.log_scales.as_flattened(), scene.log_scales.as_flattened()));
        assert!(near(&again.sh.coefficients, &scene.sh.coefficients));
        assert!(!near(&moved_scene.sh.coefficients, &scene.sh.coefficients));
        for motion in [
            Motion {
                rotation: [0.0; 4],
                ..there
            },
            Motion { scale: 0.0, ..there },
            Motion {
                shift: [f32::NAN; 3],
                ..there
            },
        ] {
            assert!(moved(&scene, motion).is_err());
        }
    }
}
