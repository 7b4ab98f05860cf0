//! Which of several compromises no other beats in every respect.
use super::bad;
use crate::Result;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Which way an objective is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Less is better, as of seconds.
    Minimise,
    /// More is better, as of decibels.
    Maximise,
}

/// Indices, ascending, of the points that no other dominates.
///
/// A point dominates another if it is at least as good in every objective and better in one. Equal points don't
/// dominate each other, so they are on the front together or not at all. Infinite values are legal: the PSNR of
/// identical pictures is one.
///
/// # Errors
/// NaN.
pub fn pareto_front<const N: usize>(points: &[[f64; N]], directions: &[Direction; N]) -> Result<Vec<usize>> {
    if let Some(row) = points.iter().position(|point| point.iter().any(|value| value.is_nan())) {
        return Err(bad("points", format!("point {row} has a value that is no number")));
    }
    // More is better from here on. Adding zero makes one zero of both, whose order must not differ.
    let gains: Vec<[f64; N]> = points
        .iter()
        .map(|point| {
            let mut gain = *point;
            for (value, direction) in gain.iter_mut().zip(directions) {
                *value = 0.0
                    + if *direction == Direction::Minimise {
                        -*value
                    } else {
                        *value
                    };
            }
            gain
        })
        .collect();
    // Best first in lexicographic order: what dominates a point comes before it, and a dominated point cannot be the
    // only one that dominates another, so that the front so far is all there is to compare with.
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| lexicographic(&gains[b], &gains[a]).then(a.cmp(&b)));
    let mut front: Vec<usize> = Vec::new();
    for index in order {
        if !front.iter().any(|&better| dominates(&gains[better], &gains[index])) {
            front.push(index);
        }
    }
    front.sort_unstable();
    Ok(front)
}

fn lexicographic(a: &[f64], b: &[f64]) -> Ordering {
    let orders = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
    orders.fold(Ordering::Equal, Ordering::then)
}

fn dominates(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a >= b) && a.iter().zip(b).any(|(a, b)| a > b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Direction::{Maximise, Minimise};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn by_hand() {
        // Seconds, success rate, PSNR.
        let points = [
            [10.0, 0.9, 38.0],
            [12.0, 0.9, 38.0], // slower than the first
            [5.0, 0.7, 30.0],
            [10.0, 0.9, 38.0], // the first again
            [60.0, 0.8, f64::INFINITY],
            [4.0, 0.7, 29.0],
            [61.0, 0.8, f64::INFINITY], // slower than another
        ];
        let front = pareto_front(&points, &[Minimise, Maximise, Maximise]).unwrap();
        assert_eq!(front, [0, 2, 3, 4, 5]);
    }

    #[test]
    fn none_one_and_nan() {
        assert!(pareto_front::<2>(&[], &[Minimise, Maximise]).unwrap().is_empty());
        assert_eq!(pareto_front(&[[1.0]], &[Minimise]).unwrap(), [0]);
        assert!(pareto_front(&[[1.0], [f64::NAN]], &[Minimise]).is_err());
        assert_eq!(pareto_front(&[[0.0], [-0.0]], &[Minimise]).unwrap(), [0, 1]);
    }

    /// Against the definition, on points with many ties.
    #[test]
    fn is_what_the_definition_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for round in 0..300 {
            let directions = [0; 3].map(|_| if rng.random() { Minimise } else { Maximise });
            let count = rng.random_range(0..40);
            let points: Vec<[f64; 3]> = (0..count)
                .map(|_| [0; 3].map(|_| f64::from(rng.random_range(-3_i32..4))))
                .collect();
            let better = |a: f64, b: f64, direction| if direction == Minimise { a < b } else { a > b };
            let beaten = |b: &[f64; 3]| {
                points.iter().any(|a| {
                    (0..3).all(|i| !better(b[i], a[i], directions[i]))
                        && (0..3).any(|i| better(a[i], b[i], directions[i]))
                })
            };
            let expected: Vec<usize> = (0..count).filter(|&i| !beaten(&points[i])).collect();
            assert_eq!(pareto_front(&points, &directions).unwrap(), expected, "round {round}");
        }
    }
}
