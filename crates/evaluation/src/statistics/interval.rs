//! Confidence intervals and the quantiles they are made of.
use super::bad;
use crate::Result;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// A two-sided confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end, not below `low`.
    pub high: f64,
}

impl Interval {
    /// The interval of half-width `half` around `centre`.
    pub(crate) fn around(centre: f64, half: f64) -> Self {
        Self {
            low: centre - half,
            high: centre + half,
        }
    }

    /// Both ends limited to `low..=high`.
    pub(crate) fn within(self, low: f64, high: f64) -> Self {
        Self {
            low: self.low.clamp(low, high),
            high: self.high.clamp(low, high),
        }
    }

    /// Whether a value lies in it, ends included.
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// Probability that is left on each side of a two-sided interval of this confidence, such as 0.025 for 0.95.
pub(crate) fn tail(confidence: f64) -> Result<f64> {
    if confidence > 0.0 && confidence < 1.0 {
        Ok((1.0 - confidence) / 2.0)
    } else {
        Err(bad(
            "confidence",
            format!("{confidence} is not between 0 and 1, both excluded"),
        ))
    }
}

/// How many standard deviations an interval of this confidence has on each side under a normal distribution.
pub(crate) fn normal_width(confidence: f64) -> Result<f64> {
    Ok(-Normal::standard().inverse_cdf(tail(confidence)?))
}

/// As [`normal_width`] under Student's t with `freedom` degrees of freedom, at least 1.
pub(crate) fn student_width(confidence: f64, freedom: usize) -> Result<f64> {
    let tail = tail(confidence)?;
    let t = StudentsT::new(0.0, 1.0, freedom as f64).map_err(|error| bad("freedom", error.to_string()))?;
    Ok(-t.inverse_cdf(tail))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        assert!((normal_width(0.95).unwrap() - 1.959_963_984_540_054).abs() < 1e-9);
        assert!((normal_width(0.99).unwrap() - 2.575_829_303_548_901).abs() < 1e-9);
        for (freedom, expected) in [
            (1, 12.706_204_736),
            (4, 2.776_445_105),
            (10, 2.228_138_852),
            (1000, 1.962_339_081),
        ] {
            let width = student_width(0.95, freedom).unwrap();
            assert!((width - expected).abs() < 1e-6, "{freedom}: {width}");
        }
    }

    #[test]
    fn confidences_outside_are_refused() {
        for confidence in [0.0, 1.0, -0.5, 95.0, f64::NAN, f64::INFINITY] {
            assert!(tail(confidence).is_err(), "{confidence}");
        }
    }
}
