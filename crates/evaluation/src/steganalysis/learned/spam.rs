//! Subtractive pixel adjacency: which differences of neighbours follow which.
//!
//! Pevny, Bas, Fridrich, "Steganalysis by subtractive pixel adjacency matrix", IEEE Transactions on Information Forensics
//! and Security 5 (2010), of second order with T = 3: 686 features.
//!
//! With `D` the differences of neighbours along a direction, the features are `Pr(D_3 = u | D_2 = v, D_1 = w)` for u, v,
//! w in -3..=3, averaged over the four directions along the axes, then over the four diagonals. Conditional on what came
//! before, they hardly depend on how much of a picture is flat: a white background makes `v = w = 0` more common, which
//! changes the seven of 343 features that are conditional on it and no other. A condition that never occurs gives 0.

/// The paper's T: larger differences are in no feature, but count as what follows.
const LIMIT: i32 = 3;
/// Values that a difference in the features has.
const VALUES: usize = 2 * LIMIT as usize + 1;
/// Features of a matrix.
const MATRIX: usize = VALUES * VALUES * VALUES;
/// Number of features.
pub(super) const FEATURES: usize = 2 * MATRIX;

/// Values of a channel, or of what was computed from channels.
pub(super) struct Plane {
    /// Values a row.
    pub width: usize,
    /// `[height][width]`.
    pub values: Vec<i16>,
}

/// Steps along the lines: right, down, and the two diagonals. The other four directions read the same lines backwards.
const STEPS: [(usize, isize); 4] = [(0, 1), (1, 0), (1, 1), (1, -1)];

/// The features of several planes, whose differences are counted together.
pub(super) fn features(planes: &[Plane]) -> Vec<f64> {
    let mut features = Vec::with_capacity(FEATURES);
    for steps in STEPS.chunks_exact(2) {
        let mut sums = vec![0.0; MATRIX];
        for step in steps {
            let mut counts = [[[0; CODES]; CODES]; CODES];
            for plane in planes {
                count(plane, *step, &mut counts);
            }
            add_probabilities(&mut sums, |w, v, u| counts[w][v][u]);
            // Backwards the order is the other one, and a drop is a rise.
            add_probabilities(&mut sums, |w, v, u| counts[opposite(u)][opposite(v)][opposite(w)]);
        }
        features.extend(sums.iter().map(|sum| sum / 4.0));
    }
    features
}

/// Differences of -3 to 3, and one code for all larger ones.
const CODES: usize = VALUES + 1;

/// How often each three differences follow each other.
type Counts = [[[u64; CODES]; CODES]; CODES];

fn code(difference: i16) -> usize {
    let limit = LIMIT as i16;
    if (-limit..=limit).contains(&difference) {
        (difference + limit) as usize
    } else {
        VALUES
    }
}

/// The code of a difference with the other sign.
fn opposite(code: usize) -> usize {
    if code < VALUES { VALUES - 1 - code } else { code }
}

/// Counts the four pixels in a row along a step that begin at every place.
fn count(plane: &Plane, (down, right): (usize, isize), counts: &mut Counts) {
    let reach = 3 * right.unsigned_abs();
    let length = plane.width.saturating_sub(reach);
    if length == 0 {
        return;
    }
    let first = if right < 0 { reach } else { 0 };
    let rows: Vec<&[i16]> = plane.values.chunks_exact(plane.width).collect();
    for lines in rows.windows(3 * down + 1) {
        // In range: `length` pixels from `start` on stay in the row whatever the step.
        let line = |step: usize| {
            let start = first.saturating_add_signed(step as isize * right);
            &lines[step * down][start..start + length]
        };
        let pixels = line(0).iter().zip(line(1)).zip(line(2)).zip(line(3));
        for (((a, b), c), d) in pixels {
            counts[code(a - b)][code(b - c)][code(c - d)] += 1;
        }
    }
}

/// Adds `Pr(u | w, v)` to `sums`, `[w][v][u]`.
fn add_probabilities(sums: &mut [f64], count: impl Fn(usize, usize, usize) -> u64) {
    for (pair, sums) in sums.chunks_exact_mut(VALUES).enumerate() {
        let (w, v) = (pair / VALUES, pair % VALUES);
        let all: u64 = (0..CODES).map(|u| count(w, v, u)).sum();
        if all > 0 {
            for (u, sum) in sums.iter_mut().enumerate() {
                *sum += count(w, v, u) as f64 / all as f64;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steganalysis::testing::noise;

    fn plane(width: usize, values: &[i16]) -> Plane {
        Plane {
            width,
            values: values.to_vec(),
        }
    }

    fn index(w: i32, v: i32, u: i32) -> usize {
        (((w + LIMIT) * 7 + v + LIMIT) * 7 + u + LIMIT) as usize
    }

    #[test]
    fn a_row_by_hand() {
        // Differences to the right: 1, -2, -2, 1, -2; to the left: 2, -1, 2, 2, -1.
        let features = features(&[plane(6, &[5, 4, 6, 8, 7, 9])]);
        let mut expected = vec![0.0; FEATURES];
        for (w, v, u) in [
            (1, -2, -2),
            (-2, -2, 1),
            (-2, 1, -2),
            (2, -1, 2),
            (-1, 2, 2),
            (2, 2, -1),
        ] {
            expected[index(w, v, u)] = 0.25;
        }
        assert_eq!(features, expected);
    }

    #[test]
    fn what_follows_counts_even_if_it_is_large() {
        let features = features(&[plane(4, &[0, 0, 0, 0]), plane(4, &[0, 0, 0, 9])]);
        assert_eq!(features[index(0, 0, 0)], 0.125 + 0.25);
    }

    /// Turned and mirrored pictures have the same features.
    #[test]
    fn directions_are_all_alike() {
        let picture = noise(23, 17, 1);
        let (width, height) = (23, 17);
        let values: Vec<i16> = picture.iter().step_by(3).map(|value| i16::from(value % 5)).collect();
        let straight = features(&[plane(width, &values)]);
        let mirrored: Vec<i16> = values.chunks(width).flat_map(|row| row.iter().rev().copied()).collect();
        let turned: Vec<i16> = (0..width)
            .flat_map(|x| (0..height).map(move |y| (x, y)))
            .map(|(x, y)| values[y * width + x])
            .collect();
        for other in [plane(width, &mirrored), plane(height, &turned)] {
            let other = features(&[other]);
            assert!(straight.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn small_planes_have_nothing_to_count() {
        for (width, values) in [(0, vec![]), (1, vec![3]), (3, vec![1; 9])] {
            assert!(features(&[plane(width, &values)]).iter().all(|value| *value == 0.0));
        }
    }
}
