//! Covariances of Gaussians, and their axes.

use crate::convert::unit;
use crate::gltf::matrix;

type Matrix = [[f64; 3]; 3];

/// Covariance of a Gaussian with a rotation w, x, y, z of any length, and standard deviations along its axes.
pub(super) fn covariance(rotation: [f32; 4], deviations: [f64; 3]) -> Matrix {
    let axes = matrix(unit(rotation));
    let entry = |i: usize, j: usize| {
        (0..3)
            .map(|k| axes[i][k] * axes[j][k] * deviations[k] * deviations[k])
            .sum()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// Squares of the deviations along the axes of a symmetric matrix, and the rotation w, x, y, z of these axes: turns in the
/// planes of two coordinates (Jacobi's method), until nothing is left beside the diagonal.
pub(super) fn axes(mut matrix: Matrix) -> ([f64; 3], [f32; 4]) {
    let mut rotation = [1.0, 0.0, 0.0, 0.0];
    for _ in 0..32 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let beside = matrix[p][q];
            if beside.abs() <= 1e-15 * (matrix[p][p].abs() + matrix[q][q].abs()) {
                continue;
            }
            let half = 0.5 * (2.0 * beside).atan2(matrix[p][p] - matrix[q][q]);
            let (sine, cosine) = half.sin_cos();
            turn(&mut matrix, p, q, sine, cosine);
            // The turn takes axis p to q; about the third axis, the other way where that order is not x, y, z, x.
            let sign = if (p, q) == (0, 2) { -1.0 } else { 1.0 };
            let mut about = [(half / 2.0).cos(), 0.0, 0.0, 0.0];
            about[1 + (3 - p - q)] = sign * (half / 2.0).sin();
            rotation = product(rotation, about);
        }
    }
    ([0, 1, 2].map(|i| matrix[i][i]), rotation.map(|v| v as f32))
}

/// The matrix in axes of which p and q are turned within their plane.
fn turn(matrix: &mut Matrix, p: usize, q: usize, sine: f64, cosine: f64) {
    for row in matrix.iter_mut() {
        let (a, b) = (row[p], row[q]);
        (row[p], row[q]) = (cosine * a + sine * b, cosine * b - sine * a);
    }
    for column in 0..3 {
        let (a, b) = (matrix[p][column], matrix[q][column]);
        (matrix[p][column], matrix[q][column]) = (cosine * a + sine * b, cosine * b - sine * a);
    }
}

fn product([w, x, y, z]: [f64; 4], [a, b, c, d]: [f64; 4]) -> [f64; 4] {
    [
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn axes_give_the_covariance_back(rotation in prop::array::uniform4(-1.0f32..1.0), deviations in prop::array::uniform3(0.0f64..3.0)) {
            let given = covariance(rotation, deviations);
            let (squares, found) = axes(given);
            let again = covariance(found, squares.map(|v| v.max(0.0).sqrt()));
            for i in 0..3 {
                for j in 0..3 {
                    prop_assert!((given[i][j] - again[i][j]).abs() < 1e-5, "{:?} {:?}", given, again);
                }
            }
        }
    }
}
