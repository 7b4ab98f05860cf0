//! What strangers do to a scene: leave Gaussians out, merge or move them, drop bands of colour, add noise. Each gives a new scene; rows that
//! stay keep their order unless it is said, and the same arguments give the same bytes.
mod edit;
mod merge;
mod symmetric;

pub use edit::{Motion, crop, moved, shuffled, without_floaters};
pub use merge::halved;

use crate::error::bad;
use crate::{Gaussians, Result, Sh};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::path::Path;

/// What messages call the scene, which has no file.
const NAME: &str = "altered scene";

/// Leaves out the `share` of the Gaussians whose opacity is lowest, rounded down to whole ones; ties by row, the first
/// go first. Viewers and optimisers do so to save memory.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): a share outside [0, 1), arrays of different lengths.
pub fn prune_faint(gaussians: &Gaussians, share: f64) -> Result<Gaussians> {
    let count = pruned(gaussians, share)?;
    // Logits rise with opacity, and tell those apart that are 0 or 1 to single precision.
    let mut order: Vec<usize> = (0..gaussians.len()).collect();
    order.sort_by(|a, b| gaussians.opacity_logits[*a].total_cmp(&gaussians.opacity_logits[*b]));
    Ok(without(gaussians, &order[..count]))
}

/// Leaves out a random `share` of the Gaussians, rounded down to whole ones.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): a share outside [0, 1), arrays of different lengths.
pub fn prune_random(gaussians: &Gaussians, share: f64, seed: u64) -> Result<Gaussians> {
    let count = pruned(gaussians, share)?;
    // Sorting random numbers shuffles; 64 bits have no ties to speak of, and the row decides those.
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut keys: Vec<(u64, usize)> = (0..gaussians.len()).map(|row| (random.random(), row)).collect();
    keys.sort_unstable();
    let rows: Vec<usize> = keys[..count].iter().map(|(_, row)| *row).collect();
    Ok(without(gaussians, &rows))
}

/// Drops the bands of spherical harmonics above `degree`. A scene that has none stays as it is.
pub fn truncate_sh(gaussians: &Gaussians, degree: usize) -> Gaussians {
    let stored = gaussians.sh.per_gaussian();
    let mut sh = Sh {
        degree: degree.min(gaussians.sh.degree),
        coefficients: Vec::new(),
    };
    let kept = sh.per_gaussian();
    let rows = gaussians.sh.coefficients.chunks_exact(stored);
    sh.coefficients = rows.flat_map(|row| &row[..kept]).copied().collect();
    Gaussians {
        positions: gaussians.positions.clone(),
        rotations: gaussians.rotations.clone(),
        log_scales: gaussians.log_scales.clone(),
        opacity_logits: gaussians.opacity_logits.clone(),
        sh,
    }
}

/// Standard deviations of normal noise on spherical harmonics coefficients, 0 or more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShNoise {
    /// Of the constant ones: 0.28 times that in colours of 0 to 1.
    pub constant: f32,
    /// Of those of all higher bands.
    pub rest: f32,
}

/// Adds independent normal noise to every coefficient. The same seed gives the same noise but for its size, whichever
/// of the deviations are 0.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): a deviation that is negative or not finite, arrays of different
/// lengths.
pub fn add_sh_noise(gaussians: &Gaussians, noise: ShNoise, seed: u64) -> Result<Gaussians> {
    check(gaussians)?;
    for (name, sigma) in [("the constant", noise.constant), ("higher", noise.rest)] {
        if !(sigma.is_finite() && sigma >= 0.0) {
            return Err(refused(format!(
                "noise of deviation {sigma} on {name} coefficients, must be finite and not negative"
            )));
        }
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut altered = gaussians.clone();
    let per_gaussian = altered.sh.per_gaussian();
    for (i, value) in altered.sh.coefficients.iter_mut().enumerate() {
        let normal: f32 = random.sample(StandardNormal);
        let sigma = if i % per_gaussian < 3 {
            noise.constant
        } else {
            noise.rest
        };
        // Sums beyond single precision get its ends: colours are finite.
        *value = (*value + sigma * normal).clamp(f32::MIN, f32::MAX);
    }
    Ok(altered)
}

fn refused(reason: String) -> crate::Error {
    bad(Path::new(NAME), reason)
}

fn check(gaussians: &Gaussians) -> Result<()> {
    crate::convert::check_arrays(gaussians).map_err(refused)
}

/// How many Gaussians a share is.
fn pruned(gaussians: &Gaussians, share: f64) -> Result<usize> {
    check(gaussians)?;
    if !(0.0..1.0).contains(&share) {
        return Err(refused(format!(
            "a share of {share} of the Gaussians left out, must be at least 0 and less than 1"
        )));
    }
    Ok((share * gaussians.len() as f64) as usize)
}

/// The Gaussians that are not in `rows`.
pub(crate) fn without(gaussians: &Gaussians, rows: &[usize]) -> Gaussians {
    let mut stays = vec![true; gaussians.len()];
    rows.iter().for_each(|row| stays[*row] = false);
    fn some<T: Copy>(values: &[T], each: usize, stays: &[bool]) -> Vec<T> {
        let rows = values.chunks_exact(each).zip(stays);
        rows.filter(|(_, stays)| **stays)
            .flat_map(|(row, _)| row)
            .copied()
            .collect()
    }
    Gaussians {
        positions: some(&gaussians.positions, 1, &stays),
        rotations: some(&gaussians.rotations, 1, &stays),
        log_scales: some(&gaussians.log_scales, 1, &stays),
        opacity_logits: some(&gaussians.opacity_logits, 1, &stays),
        sh: Sh {
            degree: gaussians.sh.degree,
            coefficients: some(&gaussians.sh.coefficients, gaussians.sh.per_gaussian(), &stays),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::tests::random;

    /// Rows of `part` among those of `whole`; positions tell them.
    fn rows_of(part: &Gaussians, whole: &Gaussians) -> Vec<usize> {
        let place = |p: &[f32; 3]| whole.positions.iter().position(|other| other == p).unwrap();
        let rows: Vec<usize> = part.positions.iter().map(place).collect();
        for (i, row) in rows.iter().enumerate() {
            let each = whole.sh.per_gaussian();
            assert_eq!(part.rotations[i], whole.rotations[*row]);
            assert_eq!(part.log_scales[i], whole.log_scales[*row]);
            assert_eq!(part.opacity_logits[i], whole.opacity_logits[*row]);
            let (part, whole) = (&part.sh.coefficients[i * each..], &whole.sh.coefficients[row * each..]);
            assert_eq!(part[..each], whole[..each]);
        }
        rows
    }

    #[test]
    fn the_faintest_go_first() {
        let mut scene = random(7, 1, 1);
        scene.opacity_logits = vec![0.0, f32::NEG_INFINITY, -30.0, 0.0, f32::INFINITY, -25.0, 0.0];
        let left = |share| rows_of(&prune_faint(&scene, share).unwrap(), &scene);
        assert_eq!(left(0.0), [0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(left(0.14), [0, 1, 2, 3, 4, 5, 6], "0.98 of one");
        assert_eq!(left(0.3), [0, 3, 4, 5, 6]);
        assert_eq!(left(0.6), [3, 4, 6], "ties by row");
        assert_eq!(left(0.999), [4]);
    }

    #[test]
    fn random_ones_are_spread_and_seeded() {
        let scene = random(2000, 0, 2);
        let left = |seed| rows_of(&prune_random(&scene, 0.25, seed).unwrap(), &scene);
        let rows = left(1);
        assert_eq!((rows.len(), rows.is_sorted()), (1500, true));
        assert_eq!(rows, left(1));
        assert_ne!(rows, left(2));
        // Of 500 each, with a deviation of 8.
        for part in 0..4 {
            let count = rows.iter().filter(|row| **row / 500 == part).count();
            assert!((count as f64 - 375.0).abs() < 50.0, "{count}");
        }
    }

    #[test]
    fn bands_are_dropped() {
        let scene = random(5, 3, 3);
        let two = truncate_sh(&scene, 2);
        assert_eq!((two.sh.degree, two.sh.coefficients.len()), (2, 5 * 27));
        assert_eq!(two.sh.coefficients[27..54], scene.sh.coefficients[48..75]);
        assert_eq!(
            (&two.positions, &two.opacity_logits),
            (&scene.positions, &scene.opacity_logits)
        );
        assert_eq!(truncate_sh(&scene, 3), scene);
        assert_eq!(truncate_sh(&scene, 9), scene);
        assert_eq!(truncate_sh(&Gaussians::default(), 0), Gaussians::default());
    }

    #[test]
    fn noise_is_normal_and_of_the_sizes_asked_for() {
        let scene = random(4000, 1, 4);
        let added = |constant, rest, seed| -> (Vec<f64>, Vec<f64>) {
            let altered = add_sh_noise(&scene, ShNoise { constant, rest }, seed).unwrap();
            let pairs = altered.sh.coefficients.iter().zip(&scene.sh.coefficients);
            let all: Vec<f64> = pairs.map(|(a, b)| f64::from(a - b)).collect();
            let rows = || all.chunks(12);
            (
                rows().flat_map(|row| row[..3].to_vec()).collect(),
                rows().flat_map(|row| row[3..].to_vec()).collect(),
            )
        };
        let moments = |values: &[f64]| {
            let n = values.len() as f64;
            let power = |p: i32| values.iter().map(|v| v.powi(p)).sum::<f64>() / n;
            (power(1), power(2).sqrt(), power(4) / power(2).powi(2))
        };
        let (constant, rest) = added(0.1, 0.02, 1);
        for (values, sigma) in [(&constant, 0.1), (&rest, 0.02)] {
            let (mean, deviation, kurtosis) = moments(values);
            assert!(
                mean.abs() < 0.05 * sigma && (deviation / sigma - 1.0).abs() < 0.03,
                "{mean} {deviation}"
            );
            assert!((kurtosis - 3.0).abs() < 0.3, "{kurtosis}");
        }
        let (none, same) = added(0.0, 0.02, 1);
        assert!(none.iter().all(|v| *v == 0.0));
        assert_eq!(same, rest);
        assert_ne!(added(0.1, 0.02, 2).0, constant);
    }

    #[test]
    fn settings_have_limits() {
        let scene = random(3, 0, 5);
        for share in [1.0, -0.1, f64::NAN, f64::INFINITY, 7.0] {
            let reason = prune_faint(&scene, share).unwrap_err().to_string();
            assert!(reason.contains(&format!("a share of {share}")), "{reason}");
            assert!(prune_random(&scene, share, 0).is_err());
        }
        for sigma in [-1e-9, f32::NAN, f32::INFINITY] {
            for (constant, rest) in [(sigma, 0.0), (0.0, sigma)] {
                let reason = add_sh_noise(&scene, ShNoise { constant, rest }, 0)
                    .unwrap_err()
                    .to_string();
                assert!(reason.contains("deviation"), "{reason}");
            }
        }
        let huge = ShNoise {
            constant: f32::MAX,
            rest: 0.0,
        };
        let noisy = add_sh_noise(&scene, huge, 0).unwrap();
        assert!(noisy.sh.coefficients.iter().all(|v| v.is_finite()));
        let mut torn = scene.clone();
        torn.rotations.pop();
        assert!(
            prune_faint(&torn, 0.5)
                .unwrap_err()
                .to_string()
                .contains("2 rotations for 3 positions")
        );
    }
}
