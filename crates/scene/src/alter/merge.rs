//! Neighbours made into one, as tools do that make coarser levels of detail.
use super::{check, symmetric};
use crate::convert::morton;
use crate::{Gaussians, Result, Sh};

/// Opacities of merged Gaussians are not beyond that, which viewers take for 1 anyway.
const MOST: f64 = 0.999;
/// Least standard deviation of a merged one: a flat axis has a logarithm then.
const LEAST: f64 = 1e-9;

/// Halves a scene: pairs of neighbours in Morton order become one each, the last of an odd number stays. Of the two, each
/// counts as its opacity times its surface; the one has their mean, their covariance about it, their mean colours, and an
/// opacity with which it covers as much as both.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene): arrays of different lengths.
pub fn halved(gaussians: &Gaussians) -> Result<Gaussians> {
    check(gaussians)?;
    let mut all = Gaussians {
        sh: Sh {
            degree: gaussians.sh.degree,
            coefficients: Vec::new(),
        },
        ..Gaussians::default()
    };
    for pair in morton(&gaussians.positions).chunks(2) {
        match *pair {
            [a, b] => merge(gaussians, [a, b], &mut all),
            _ => pair.iter().for_each(|row| keep(gaussians, *row, &mut all)),
        }
    }
    Ok(all)
}

fn colours(gaussians: &Gaussians, row: usize) -> &[f32] {
    let each = gaussians.sh.per_gaussian();
    &gaussians.sh.coefficients[row * each..(row + 1) * each]
}

fn keep(gaussians: &Gaussians, row: usize, all: &mut Gaussians) {
    all.positions.push(gaussians.positions[row]);
    all.rotations.push(gaussians.rotations[row]);
    all.log_scales.push(gaussians.log_scales[row]);
    all.opacity_logits.push(gaussians.opacity_logits[row]);
    all.sh.coefficients.extend(colours(gaussians, row));
}

fn merge(gaussians: &Gaussians, pair: [usize; 2], all: &mut Gaussians) {
    let deviations = pair.map(|row| gaussians.log_scales[row].map(|v| f64::from(v).exp()));
    let cover = [0, 1].map(|i| f64::from(gaussians.opacity(pair[i])) * surface(deviations[i]));
    let total = cover[0] + cover[1];
    // Two that nobody sees count alike.
    let share = if total > 0.0 {
        cover.map(|v| v / total)
    } else {
        [0.5; 2]
    };
    let positions = pair.map(|row| gaussians.positions[row].map(f64::from));
    let mean: [f64; 3] = std::array::from_fn(|i| share[0] * positions[0][i] + share[1] * positions[1][i]);
    let mut covariance = [[0.0; 3]; 3];
    for i in 0..2 {
        let own = symmetric::covariance(gaussians.rotations[pair[i]], deviations[i]);
        for (row, line) in covariance.iter_mut().enumerate() {
            for (column, entry) in line.iter_mut().enumerate() {
                let apart = (positions[i][row] - mean[row]) * (positions[i][column] - mean[column]);
                *entry += share[i] * (own[row][column] + apart);
            }
        }
    }
    let (squares, rotation) = symmetric::axes(covariance);
    let merged = squares.map(|v| v.max(0.0).sqrt().max(LEAST));
    let opacity = (total / surface(merged)).clamp(1e-6, MOST);
    all.positions.push(mean.map(|v| v as f32));
    all.rotations.push(rotation);
    all.log_scales.push(merged.map(|v| v.ln() as f32));
    all.opacity_logits.push((opacity / (1.0 - opacity)).ln() as f32);
    let both = colours(gaussians, pair[0]).iter().zip(colours(gaussians, pair[1]));
    let mixed = both.map(|(a, b)| (share[0] * f64::from(*a) + share[1] * f64::from(*b)) as f32);
    all.sh.coefficients.extend(mixed);
}

/// Of an ellipsoid, nearly and but for a factor: what it covers, seen from all around.
fn surface([a, b, c]: [f64; 3]) -> f64 {
    let power = |v: f64| v.powf(1.6);
    ((power(a * b) + power(b * c) + power(c * a)) / 3.0).powf(1.0 / 1.6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::tests::random;

    #[test]
    fn two_alike_at_one_place_are_one() {
        let mut scene = random(1, 2, 5);
        scene.log_scales[0] = [-1.0, -2.0, -3.0];
        scene.opacity_logits[0] = -1.5;
        let mut two = scene.clone();
        two.positions.extend(scene.positions.clone());
        two.rotations.extend(scene.rotations.clone());
        two.log_scales.extend(scene.log_scales.clone());
        two.opacity_logits.extend(scene.opacity_logits.clone());
        two.sh.coefficients.extend(scene.sh.coefficients.clone());
        let one = halved(&two).unwrap();
        assert_eq!((one.len(), &one.positions), (1, &scene.positions));
        let mut scales = one.log_scales[0];
        scales.sort_by(f32::total_cmp);
        assert!(
            scales.iter().zip([-3.0, -2.0, -1.0]).all(|(a, b)| (a - b).abs() < 1e-4),
            "{scales:?}"
        );
        // It covers as much as both.
        assert!((one.opacity(0) - 2.0 * scene.opacity(0)).abs() < 1e-3);
        for (a, b) in one.sh.coefficients.iter().zip(&scene.sh.coefficients) {
            assert!((a - b).abs() < 1e-6);
        }
    }

    #[test]
    fn two_apart_are_a_long_one() {
        let mut scene = random(2, 0, 6);
        scene.positions = vec![[0.0; 3], [2.0, 0.0, 0.0]];
        scene.log_scales = vec![[-3.0; 3]; 2];
        scene.opacity_logits = vec![0.0; 2];
        let one = halved(&scene).unwrap();
        assert_eq!(one.positions, [[1.0, 0.0, 0.0]]);
        let longest = one.log_scales[0].into_iter().fold(f32::MIN, f32::max);
        assert!((longest - (1.0f64 + (-6.0f64).exp()).sqrt().ln() as f32).abs() < 1e-5);
        assert!(one.opacity(0) < 0.5);
    }

    #[test]
    fn numbers_stay_numbers() {
        for rows in [0, 1, 7, 300] {
            let one = halved(&random(rows, 3, rows as u64)).unwrap();
            assert_eq!(one.len(), rows.div_ceil(2));
            let mut bytes = Vec::new();
            crate::convert::convert(&one, crate::Format::Ply, std::path::Path::new("it"), &mut bytes).unwrap();
        }
    }
}
