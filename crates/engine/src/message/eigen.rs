//! Eigenvectors of a symmetric matrix: Householder reduction to tridiagonal form, then implicit QL with Wilkinson
//! shifts (Golub & Van Loan, Matrix Computations, sections 8.3.1 and 8.3.3). A few seconds at n = 1024.

use super::matrix::dot;

/// Eigenvalues in descending order and the unit eigenvectors as rows.
pub(crate) struct Eigen {
    pub values: Vec<f64>,
    /// `n * n`, row i belongs to `values[i]`.
    pub vectors: Vec<f64>,
}

/// Decomposes a symmetric `n` x `n` matrix; `None` when it holds values that are not finite.
///
/// The sign of an eigenvector is fixed (its largest entry is positive), so that equal input gives equal output.
pub(crate) fn symmetric(matrix: Vec<f64>, n: usize) -> Option<Eigen> {
    debug_assert_eq!(matrix.len(), n * n);
    if matrix.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let (mut diagonal, mut off, mut rows) = tridiagonal(matrix, n);
    ql(&mut diagonal, &mut off, &mut rows)?;
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| diagonal[b].total_cmp(&diagonal[a]));
    let mut vectors = Vec::with_capacity(n * n);
    for &i in &order {
        let row = &rows[i * n..(i + 1) * n];
        let largest = row
            .iter()
            .copied()
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))
            .unwrap_or(1.0);
        let sign = 1_f64.copysign(largest);
        vectors.extend(row.iter().map(|v| sign * v));
    }
    Some(Eigen {
        values: order.iter().map(|&i| diagonal[i]).collect(),
        vectors,
    })
}

/// Diagonal, off-diagonal and the rows of Q with `Q A Q^T` tridiagonal.
fn tridiagonal(mut a: Vec<f64>, n: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let mut q = vec![0.0; n * n];
    (0..n).for_each(|i| q[i * n + i] = 1.0);
    for k in 0..n.saturating_sub(2) {
        let first = k + 1;
        let mut v = a[k * n + first..first * n].to_vec();
        let norm = dot(&v, &v).sqrt();
        if norm == 0.0 {
            continue;
        }
        let alpha = -norm.copysign(v[0]);
        v[0] -= alpha;
        let length = dot(&v, &v).sqrt();
        v.iter_mut().for_each(|x| *x /= length);
        // A <- H A H with H = I - 2 v v^T, written as a rank-two update of the trailing block.
        let mut w: Vec<f64> = a[first * n..]
            .chunks_exact(n)
            .map(|row| dot(&row[first..], &v))
            .collect();
        let vw = dot(&v, &w);
        w.iter_mut().zip(&v).for_each(|(w, v)| *w = 2.0 * (*w - vw * v));
        for (i, row) in a[first * n..].chunks_exact_mut(n).enumerate() {
            let (vi, wi) = (v[i], w[i]);
            row[first..]
                .iter_mut()
                .zip(v.iter().zip(&w))
                .for_each(|(x, (v, w))| *x -= vi * w + wi * v);
        }
        a[k * n + first] = alpha;
        // Q <- H Q
        let mut sum = vec![0.0; n];
        for (row, &v) in q[first * n..].chunks_exact(n).zip(&v) {
            sum.iter_mut().zip(row).for_each(|(s, x)| *s += v * x);
        }
        for (row, &v) in q[first * n..].chunks_exact_mut(n).zip(&v) {
            row.iter_mut().zip(&sum).for_each(|(x, s)| *x -= 2.0 * v * s);
        }
    }
    let diagonal = (0..n).map(|i| a[i * n + i]).collect();
    let off = (0..n).map(|i| if i + 1 < n { a[i * n + i + 1] } else { 0.0 }).collect();
    (diagonal, off, q)
}

/// Diagonalises a tridiagonal matrix, turning the rows of `q` along. `None` if it does not converge.
fn ql(d: &mut [f64], e: &mut [f64], q: &mut [f64]) -> Option<()> {
    let n = d.len();
    let scale = d.iter().chain(&*e).fold(0_f64, |max, x| max.max(x.abs()));
    // Absolute rather than relative: covariances of few samples have whole blocks of zero eigenvalues.
    let negligible = f64::EPSILON * scale;
    for l in 0..n {
        let mut tries = 0;
        loop {
            let m = (l..n - 1).find(|&m| e[m].abs() <= negligible).unwrap_or(n - 1);
            if m == l {
                break;
            }
            tries += 1;
            if tries > 100 {
                return None;
            }
            let shift = (d[l + 1] - d[l]) / (2.0 * e[l]);
            let mut g = d[m] - d[l] + e[l] / (shift + shift.hypot(1.0).copysign(shift));
            let (mut sine, mut cosine, mut p) = (1.0, 1.0, 0.0);
            let mut finished = true;
            for i in (l..m).rev() {
                let (f, b) = (sine * e[i], cosine * e[i]);
                let r = f.hypot(g);
                e[i + 1] = r;
                if r == 0.0 {
                    d[i + 1] -= p;
                    e[m] = 0.0;
                    finished = false;
                    break;
                }
                (sine, cosine) = (f / r, g / r);
                g = d[i + 1] - p;
                let t = (d[i] - g) * sine + 2.0 * cosine * b;
                p = sine * t;
                d[i + 1] = g + p;
                g = cosine * t - b;
                let (upper, lower) = q[i * n..(i + 2) * n].split_at_mut(n);
                for (x, y) in upper.iter_mut().zip(lower) {
                    (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
                }
            }
            if finished {
                d[l] -= p;
                e[l] = g;
                e[m] = 0.0;
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A random covariance of `samples` samples in n dimensions.
    fn covariance(n: usize, samples: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut a = vec![0.0; n * n];
        for _ in 0..samples {
            let x: Vec<f64> = (0..n).map(|i| (rng.random::<f64>() - 0.5) / (1 + i) as f64).collect();
            (0..n * n).for_each(|k| a[k] += x[k / n] * x[k % n]);
        }
        a
    }

    fn check(a: &[f64], n: usize) {
        let eigen = symmetric(a.to_vec(), n).unwrap();
        assert!(eigen.values.windows(2).all(|w| w[0] >= w[1]));
        let scale = eigen.values[0].abs().max(1e-300);
        for (i, v) in eigen.vectors.chunks_exact(n).enumerate() {
            for (row, x) in a.chunks_exact(n).zip(v) {
                assert!((dot(row, v) - eigen.values[i] * x).abs() < 1e-12 * scale);
            }
            for (j, u) in eigen.vectors.chunks_exact(n).enumerate() {
                assert!((dot(u, v) - f64::from(u8::from(i == j))).abs() < 1e-12, "{i} {j}");
            }
        }
    }

    #[test]
    fn vectors_are_orthonormal_and_solve_the_equation() {
        for (n, samples) in [(1, 3), (2, 5), (3, 9), (17, 100), (64, 200)] {
            check(&covariance(n, samples, n as u64), n);
        }
    }

    #[test]
    fn rank_deficient_diagonal_and_equal_eigenvalues() {
        check(&covariance(40, 6, 1), 40);
        let mut identity = vec![0.0; 81];
        (0..9).for_each(|i| identity[i * 9 + i] = 1.0);
        check(&identity, 9);
        check(&[0.0; 16], 4);
    }

    #[test]
    fn known_values() {
        let eigen = symmetric(vec![2.0, 1.0, 1.0, 2.0], 2).unwrap();
        assert!((eigen.values[0] - 3.0).abs() < 1e-14 && (eigen.values[1] - 1.0).abs() < 1e-14);
        assert!((eigen.vectors[0] - 0.5_f64.sqrt()).abs() < 1e-14);
        assert!(symmetric(vec![f64::NAN], 1).is_none());
    }
}
