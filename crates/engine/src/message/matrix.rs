//! Products of small dense matrices, row-major, in f64 and in a fixed order of summation.

/// Inner product.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `B C B^T` of rows B (k x width) and a symmetric C (width x width).
pub(crate) fn congruence(basis: &[f64], matrix: &[f64], width: usize) -> Vec<f64> {
    let turned = product(basis, matrix, width, width);
    turned
        .chunks_exact(width)
        .flat_map(|row| basis.chunks_exact(width).map(move |b| dot(row, b)))
        .collect()
}

/// Product of row-major `[.. x inner]` and `[inner x columns]`.
pub(crate) fn product(a: &[f64], b: &[f64], inner: usize, columns: usize) -> Vec<f64> {
    let mut out = vec![0.0; a.len() / inner * columns];
    for (row, out) in a.chunks_exact(inner).zip(out.chunks_exact_mut(columns)) {
        for (&x, b) in row.iter().zip(b.chunks_exact(columns)) {
            out.iter_mut().zip(b).for_each(|(o, b)| *o += x * b);
        }
    }
    out
}
