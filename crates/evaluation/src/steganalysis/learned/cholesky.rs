//! Solves `A x = b` of a symmetric positive definite matrix.
//!
//! Forty lines of our own rather than a library of linear algebra: that would be the largest dependency of this crate for
//! one call, and those that use the vector instructions of the CPU give other last digits on another CPU.

/// Solves in place: `b` becomes the solution. `upper` is `[n][n]`, of which only what is on and above the diagonal is
/// read; it is overwritten. `false`, with `b` undefined, if the matrix is not positive definite.
pub(super) fn solve(upper: &mut [f64], b: &mut [f64]) -> bool {
    let n = b.len();
    // A = Uᵀ U, row by row of U; each is subtracted from the rows below.
    for k in 0..n {
        let (done, below) = upper.split_at_mut((k + 1) * n);
        let row = &mut done[k * n..];
        let pivot = row[k].sqrt();
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        row[k..].iter_mut().for_each(|value| *value /= pivot);
        for i in k + 1..n {
            let factor = row[i];
            let target = &mut below[(i - k - 1) * n + i..(i - k) * n];
            for (target, value) in target.iter_mut().zip(&row[i..]) {
                *target -= factor * value;
            }
        }
    }
    // Uᵀ y = b, then U x = y.
    for k in 0..n {
        let row = &upper[k * n..(k + 1) * n];
        b[k] /= row[k];
        let value = b[k];
        for (b, factor) in b[k + 1..].iter_mut().zip(&row[k + 1..]) {
            *b -= factor * value;
        }
    }
    for k in (0..n).rev() {
        let row = &upper[k * n..(k + 1) * n];
        let sum: f64 = row[k + 1..].iter().zip(&b[k + 1..]).map(|(factor, x)| factor * x).sum();
        b[k] = (b[k] - sum) / row[k];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn solutions_solve() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for n in [1, 2, 7, 40] {
            let factor: Vec<f64> = (0..n * n).map(|_| rng.random::<f64>() - 0.5).collect();
            let mut matrix = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    matrix[i * n + j] = (0..n).map(|k| factor[i * n + k] * factor[j * n + k]).sum();
                }
                matrix[i * n + i] += 0.1;
            }
            let x: Vec<f64> = (0..n).map(|_| rng.random::<f64>()).collect();
            let mut b: Vec<f64> = (0..n).map(|i| (0..n).map(|j| matrix[i * n + j] * x[j]).sum()).collect();
            // What is below the diagonal must not matter.
            for i in 0..n {
                matrix[i * n..i * n + i].fill(f64::NAN);
            }
            assert!(solve(&mut matrix, &mut b));
            assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-9));
        }
    }

    #[test]
    fn indefinite_matrices_are_refused() {
        assert!(!solve(&mut [1.0, 2.0, 2.0, 1.0], &mut [1.0, 1.0]));
        assert!(!solve(&mut [0.0], &mut [1.0]));
        assert!(!solve(&mut [f64::NAN], &mut [1.0]));
        assert!(solve(&mut [], &mut []));
    }
}
