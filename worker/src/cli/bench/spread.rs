//! The median of what was measured, and how far it lies apart.
use std::fmt;

use serde::Serialize;

/// Median and the 10th and 90th percentile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub median: f64,
    pub p10: f64,
    pub p90: f64,
    /// How many were measured.
    pub count: usize,
}

impl Spread {
    /// Of what was measured; `None` where nothing was.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        // Between the two nearest, in proportion.
        let quantile = |share: f64| {
            let at = share * last as f64;
            let (low, high) = (values[at.floor() as usize], values[at.ceil() as usize]);
            low + (high - low) * at.fract()
        };
        Some(Self {
            median: quantile(0.5),
            p10: quantile(0.1),
            p90: quantile(0.9),
            count: values.len(),
        })
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} ({:.2} to {:.2})", self.median, self.p10, self.p90)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_the_nearest() {
        assert_eq!(Spread::of(Vec::new()), None);
        let one = Spread::of(vec![3.0]).unwrap();
        assert_eq!((one.median, one.p10, one.p90, one.count), (3.0, 3.0, 3.0, 1));
        let some = Spread::of(vec![5.0, 1.0, 2.0, 4.0]).unwrap();
        assert_eq!(some.median, 3.0);
        assert!((some.p10 - 1.3).abs() < 1e-12 && (some.p90 - 4.7).abs() < 1e-12);
        assert_eq!(some.to_string(), "3.00 (1.30 to 4.70)");
    }
}
