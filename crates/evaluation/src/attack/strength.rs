//! How strong an attack is: one number, or a range from which each picture draws its own.
use std::fmt;
use std::str::FromStr;

use crate::{Error, Result};

/// One number, or a range from which each picture draws its own; finite, and ordered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strength {
    low: f64,
    high: f64,
}

impl Strength {
    /// A range with both ends, of which `low == high` is one number.
    ///
    /// # Errors
    /// [`Error::BadOption`] for numbers that are not finite or are out of order.
    pub fn new(low: f64, high: f64) -> Result<Self> {
        if !(low.is_finite() && high.is_finite() && low <= high) {
            return Err(Error::BadOption {
                field: "strength",
                reason: format!("{low}..{high} is not a range of finite numbers from low to high"),
            });
        }
        // Adding zero turns -0, which prints a sign, into 0.
        Ok(Self {
            low: low + 0.0,
            high: high + 0.0,
        })
    }

    /// What was drawn from this range.
    pub(super) fn became(self, value: f64) -> Self {
        let value = value.clamp(self.low, self.high);
        Self {
            low: value,
            high: value,
        }
    }

    /// The lower end.
    pub fn low(self) -> f64 {
        self.low
    }

    /// The upper end.
    pub fn high(self) -> f64 {
        self.high
    }

    /// Whether every picture gets the same.
    pub fn is_fixed(self) -> bool {
        self.low == self.high
    }
}

impl fmt::Display for Strength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_fixed() {
            write!(f, "{}", self.low)
        } else {
            write!(f, "{}..{}", self.low, self.high)
        }
    }
}

impl FromStr for Strength {
    type Err = Error;

    /// Reads `0.5` or `0.5..1.5`.
    fn from_str(text: &str) -> Result<Self> {
        let (low, high) = text.split_once("..").unwrap_or((text, text));
        Self::new(number(low)?, number(high)?)
    }
}

fn number(text: &str) -> Result<f64> {
    text.parse().map_err(|_| Error::BadOption {
        field: "strength",
        reason: format!("{:?} is not a number", start_of(text)),
    })
}

/// Enough of a text to recognise it by in a message.
pub(super) fn start_of(text: &str) -> String {
    text.chars().take(40).collect()
}
