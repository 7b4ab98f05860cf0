//! A sample in five numbers.
use super::{bad, check_finite};
use crate::Result;
use serde::{Deserialize, Serialize};

/// Mean, spread and order statistics of a sample, in the sample's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of values, at least 1.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation with `count - 1` in the denominator; `None` of one value.
    pub standard_deviation: Option<f64>,
    /// Smallest value.
    pub min: f64,
    /// Middle value, or the mean of the two in the middle.
    pub median: f64,
    /// Largest value.
    pub max: f64,
}

impl Summary {
    /// Of a sample, or `None` of an empty one.
    ///
    /// # Errors
    /// A value that is not finite. PSNR of identical pictures is infinite: count those apart.
    pub fn of(values: &[f64]) -> Result<Option<Self>> {
        check_finite("values", values)?;
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (Some(&min), Some(&max)) = (sorted.first(), sorted.last()) else {
            return Ok(None);
        };
        let (mean, standard_deviation) = mean_and_deviation(values)?;
        let count = values.len();
        let (lower, upper) = (sorted[(count - 1) / 2], sorted[count / 2]);
        Ok(Some(Self {
            count,
            mean,
            standard_deviation,
            min,
            median: f64::midpoint(lower, upper),
            max,
        }))
    }
}

/// Mean, and standard deviation where there are two values or more.
///
/// # Errors
/// No value, or one whose sum or square is beyond what a number can hold.
pub(crate) fn mean_and_deviation(values: &[f64]) -> Result<(f64, Option<f64>)> {
    if values.is_empty() {
        return Err(bad("values", "there are none"));
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    // Around the mean, since the difference of large sums of squares loses the digits.
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    let deviation = (values.len() > 1).then(|| (squares / (count - 1.0)).sqrt());
    if !mean.is_finite() || !squares.is_finite() {
        return Err(bad("values", "their squares are too large to be summed"));
    }
    Ok((mean, deviation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let summary = Summary::of(&[4.0, 2.0, 5.0, 4.0, 7.0, 5.0, 4.0, 9.0]).unwrap().unwrap();
        assert_eq!((summary.count, summary.mean, summary.median), (8, 5.0, 4.5));
        assert_eq!((summary.min, summary.max), (2.0, 9.0));
        assert!((summary.standard_deviation.unwrap() - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        assert_eq!(Summary::of(&[3.0, 1.0, 2.0]).unwrap().unwrap().median, 2.0);
    }

    #[test]
    fn none_one_and_not_finite() {
        assert_eq!(Summary::of(&[]).unwrap(), None);
        let one = Summary::of(&[0.25]).unwrap().unwrap();
        assert_eq!((one.mean, one.median, one.standard_deviation), (0.25, 0.25, None));
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(Summary::of(&[1.0, value]).is_err());
        }
        assert!(Summary::of(&[1e300, -1e300]).is_err());
    }

    #[test]
    fn large_offsets_keep_the_spread() {
        let values = [1e9 + 4.0, 1e9 + 7.0, 1e9 + 13.0, 1e9 + 16.0];
        let summary = Summary::of(&values).unwrap().unwrap();
        assert!((summary.standard_deviation.unwrap() - 30.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn survives_json() {
        for values in [vec![0.1, 0.7, 0.25], vec![0.3]] {
            let summary = Summary::of(&values).unwrap().unwrap();
            let text = serde_json::to_string(&summary).unwrap();
            assert_eq!(serde_json::from_str::<Summary>(&text).unwrap(), summary);
        }
    }
}
