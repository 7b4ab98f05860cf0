//! How far a gradient is from another: four measures that must hold together, because each alone can be fooled.

/// Distance of a gradient from the one it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GradientError {
    /// `sum |got - want| / sum |want|`.
    pub l1: f64,
    /// `|got - want|_2 / |want|_2`: finds single large errors.
    pub l2: f64,
    /// One minus the cosine of the angle between them: finds wrong directions.
    pub angle: f64,
    /// `sum (got - want) sign(want) / sum |want|`: finds gradients that are a little too small everywhere.
    pub bias: f64,
}

impl GradientError {
    /// Compares two gradients of one length. Two zero gradients are equal; NaN anywhere makes every measure NaN.
    pub fn new(got: &[f32], want: &[f64]) -> Self {
        assert_eq!(got.len(), want.len(), "gradients of different lengths");
        let [mut sum, mut square, mut got_square, mut dot, mut d1, mut d2, mut signed] = [0.0f64; 7];
        for (g, w) in got.iter().zip(want) {
            let (g, d) = (f64::from(*g), f64::from(*g) - w);
            sum += w.abs();
            square += w * w;
            got_square += g * g;
            dot += g * w;
            d1 += d.abs();
            d2 += d * d;
            signed += d * if *w == 0.0 { 0.0 } else { w.signum() };
        }
        let ratio = |a: f64, b: f64| if a == 0.0 { 0.0 } else { a / b };
        let angle = if square == 0.0 && got_square == 0.0 {
            0.0
        } else {
            1.0 - dot / (square * got_square).sqrt()
        };
        GradientError {
            l1: ratio(d1, sum),
            l2: ratio(d2.sqrt(), square.sqrt()),
            angle,
            bias: ratio(signed, sum),
        }
    }

    /// Whether all four are within the limit; the angle, being quadratic in the error, within its square.
    pub fn within(&self, limit: f64) -> bool {
        self.l1 <= limit && self.l2 <= limit && self.angle <= limit * limit && self.bias.abs() <= 0.5 * limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(change: impl Fn(usize, f64) -> f64) -> GradientError {
        let want: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.37).sin()).collect();
        let got: Vec<f32> = want.iter().enumerate().map(|(i, w)| change(i, *w) as f32).collect();
        GradientError::new(&got, &want)
    }

    #[test]
    fn rounding_passes() {
        assert!(error(|_, w| w).within(1e-6));
    }

    #[test]
    fn each_kind_of_error_is_found() {
        assert!(!error(|_, w| 0.999 * w).within(1e-3), "scaled: seen by the bias");
        assert!(error(|_, w| 0.999 * w).angle < 1e-12, "but not by the cosine");
        assert!(
            !error(|i, w| if i == 3 { w + 0.1 } else { w }).within(1e-3),
            "one outlier: seen by L2"
        );
        assert!(
            error(|i, w| if i == 3 { w + 0.1 } else { w }).l1 < 1e-3,
            "but not by L1"
        );
        assert!(
            !error(|i, w| if i % 2 == 0 { 0.0 } else { w }).within(1e-1),
            "half missing"
        );
        assert!(!error(|_, w| -w).within(1.0), "wrong sign");
        assert!(
            !error(|i, w| if i == 5 { f64::NAN } else { w }).within(1e9),
            "not a number"
        );
        assert!(!error(|_, _| 0.0).within(0.5), "all zero");
    }

    #[test]
    fn zero_gradients_are_equal() {
        assert!(GradientError::new(&[0.0; 3], &[0.0; 3]).within(0.0));
        assert!(!GradientError::new(&[0.0, 1e-9], &[0.0; 2]).within(0.1));
    }
}
