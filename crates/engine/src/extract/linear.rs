//! Small systems of linear equations.

/// Solves `a x = y` for symmetric positive definite `a` (n by n, rows, of which the lower triangle counts) and each column of
/// `y` (n by m), by Cholesky's decomposition; `None` where a pivot is not above `least`.
pub(super) fn solve<const M: usize>(mut a: Vec<f64>, mut y: Vec<[f64; M]>, least: f64) -> Option<Vec<[f64; M]>> {
    let n = y.len();
    for j in 0..n {
        for k in 0..j {
            let factor = a[j * n + k];
            for i in j..n {
                a[i * n + j] -= a[i * n + k] * factor;
            }
        }
        let pivot = a[j * n + j];
        if !(pivot > least && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        (j..n).for_each(|i| a[i * n + j] /= root);
    }
    for i in 0..n {
        for k in 0..i {
            let (factor, before) = (a[i * n + k], y[k]);
            (0..M).for_each(|m| y[i][m] -= factor * before[m]);
        }
        y[i] = y[i].map(|v| v / a[i * n + i]);
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            let (factor, after) = (a[k * n + i], y[k]);
            (0..M).for_each(|m| y[i][m] -= factor * after[m]);
        }
        y[i] = y[i].map(|v| v / a[i * n + i]);
    }
    Some(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_solved_solves() {
        let a = [4.0, 1.0, -1.0, 1.0, 3.0, 0.5, -1.0, 0.5, 2.0];
        let y = [[1.0, 0.0], [2.0, -1.0], [3.0, 5.0]];
        let x = solve(a.to_vec(), y.to_vec(), 0.0).unwrap();
        for (row, wanted) in a.chunks_exact(3).zip(y) {
            for (m, wanted) in wanted.into_iter().enumerate() {
                let got: f64 = row.iter().zip(&x).map(|(a, x)| a * x[m]).sum();
                assert!((got - wanted).abs() < 1e-12, "{got} {wanted}");
            }
        }
    }

    #[test]
    fn what_has_no_solution_has_none() {
        assert_eq!(solve(vec![1.0, 2.0, 2.0, 1.0], vec![[1.0]; 2], 0.0), None);
        assert_eq!(solve(vec![f64::NAN], vec![[1.0]], 0.0), None);
        assert_eq!(solve::<1>(Vec::new(), Vec::new(), 0.0), Some(Vec::new()));
    }
}
