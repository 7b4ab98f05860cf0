//! Intervals of confidence for tables.

/// Quantile of the normal distribution for 95 %, two-sided.
const Z: f64 = 1.959_963_984_540_054;

/// Quantiles of Student's t for 95 %, two-sided, by degrees of freedom from 1.
const T: [f64; 30] = [
    12.706_205, 4.302_653, 3.182_446, 2.776_445, 2.570_582, 2.446_912, 2.364_624, 2.306_004, 2.262_157, 2.228_139,
    2.200_985, 2.178_813, 2.160_369, 2.144_787, 2.131_450, 2.119_905, 2.109_816, 2.100_922, 2.093_024, 2.085_963,
    2.079_614, 2.073_873, 2.068_658, 2.063_899, 2.059_539, 2.055_529, 2.051_831, 2.048_407, 2.045_230, 2.042_272,
];

/// Mean of some values with its interval, if there are any; the interval takes two.
pub(super) fn mean(values: &[f64]) -> Option<(f64, Option<[f64; 2]>)> {
    let n = values.len() as f64;
    if values.is_empty() {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    if values.len() < 2 {
        return Some((mean, None));
    }
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let half = t(values.len() - 1) * (variance / n).sqrt();
    Some((mean, Some([mean - half, mean + half])))
}

/// Student's t for 95 %; beyond the table the first two terms of its expansion (Abramowitz and Stegun 26.7.5).
fn t(freedom: usize) -> f64 {
    let expansion = || {
        let n = freedom as f64;
        let (z3, z5) = (Z.powi(3), Z.powi(5));
        Z + (z3 + Z) / (4.0 * n) + (5.0 * z5 + 16.0 * z3 + 3.0 * Z) / (96.0 * n * n)
    };
    let known = freedom.checked_sub(1).and_then(|place| T.get(place));
    known.copied().unwrap_or_else(expansion)
}

/// Wilson's interval of a share, 0..=1; everything without trials (Wilson 1927).
pub(super) fn wilson(right: usize, of: usize) -> [f64; 2] {
    if of == 0 {
        return [0.0, 1.0];
    }
    let (n, p, z2) = (of as f64, right as f64 / of as f64, Z * Z);
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    // At the ends the formula is exact on paper, but not in floating point.
    let low = if right == 0 { 0.0 } else { (centre - half).max(0.0) };
    let high = if right == of { 1.0 } else { (centre + half).min(1.0) };
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_known_values() {
        assert_eq!(mean(&[]), None);
        assert_eq!(mean(&[0.5]), Some((0.5, None)));
        // Deviation 1, standard error 1/sqrt(3), t of 2 degrees 4.302653.
        let (middle, interval) = mean(&[1.0, 2.0, 3.0]).unwrap();
        let [low, high] = interval.unwrap();
        assert_eq!(middle, 2.0);
        assert!((high - 2.0 - 2.484_138).abs() < 1e-5 && (2.0 - low - 2.484_138).abs() < 1e-5);
    }

    #[test]
    fn the_expansion_joins_the_table() {
        // From tables: 2.039513 for 31 degrees, 1.983972 for 100.
        assert!((t(31) - 2.039_513).abs() < 2e-4);
        assert!((t(100) - 1.983_972).abs() < 2e-5);
    }

    #[test]
    fn wilson_of_known_shares() {
        // 8 of 10: 0.490162 to 0.943318.
        let [low, high] = wilson(8, 10);
        assert!((low - 0.490_162).abs() < 1e-5 && (high - 0.943_318).abs() < 1e-5);
        assert_eq!(wilson(0, 10)[0], 0.0);
        assert_eq!(wilson(10, 10)[1], 1.0);
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
    }
}
