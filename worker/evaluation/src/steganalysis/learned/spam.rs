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
        let mut mean = vec![0.0; MATRIX];
        for step in steps {
            let mut forwards = Transitions::new();
            let mut backwards = Transitions::new();
            for plane in planes {
                count(plane, *step, &mut forwards, &mut backwards);
            }
            forwards.add_probabilities(&mut mean);
            backwards.add_probabilities(&mut mean);
        }
        features.extend(mean.iter().map(|sum| sum / 4.0));
    }
    features
}

/// Counts the four pixels in a row along a step that begin at every place.
fn count(plane: &Plane, (down, right): (usize, isize), forwards: &mut Transitions, backwards: &mut Transitions) {
    if plane.width == 0 {
        return;
    }
    let width = plane.width as isize;
    let columns = (-3 * right).max(0)..(width - (3 * right).max(0)).max(0);
    let height = plane.values.len() / plane.width;
    for y in 0..height.saturating_sub(3 * down) {
        for x in columns.clone() {
            // In range: three steps along the line stay in the picture.
            let at = |steps: usize| {
                let column = (x + steps as isize * right) as usize;
                i32::from(plane.values[(y + steps * down) * plane.width + column])
            };
            let (a, b, c, d) = (at(0), at(1), at(2), at(3));
            forwards.add(a - b, b - c, c - d);
            backwards.add(d - c, c - b, b - a);
        }
    }
}

/// How often what follows two differences.
struct Transitions {
    /// `[w][v][u]`
    triples: Vec<u64>,
    /// `[w][v]`, whatever follows.
    pairs: Vec<u64>,
}

impl Transitions {
    fn new() -> Self {
        Self {
            triples: vec![0; MATRIX],
            pairs: vec![0; VALUES * VALUES],
        }
    }

    fn add(&mut self, w: i32, v: i32, u: i32) {
        let index = |difference: i32| usize::try_from(difference + LIMIT).ok().filter(|index| *index < VALUES);
        let (Some(w), Some(v)) = (index(w), index(v)) else {
            return;
        };
        let pair = w * VALUES + v;
        self.pairs[pair] += 1;
        if let Some(u) = index(u) {
            self.triples[pair * VALUES + u] += 1;
        }
    }

    fn add_probabilities(&self, sums: &mut [f64]) {
        let counts = self.triples.chunks_exact(VALUES).zip(&self.pairs);
        for (sums, (triples, pair)) in sums.chunks_exact_mut(VALUES).zip(counts) {
            if *pair > 0 {
                for (sum, triple) in sums.iter_mut().zip(triples) {
                    *sum += *triple as f64 / *pair as f64;
                }
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
