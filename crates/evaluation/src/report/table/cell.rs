//! Cells of tables, and the text that they are in every output.
use crate::report::summary::{Estimate, Psnr, Share};
use serde::Serialize;
use std::fmt;

/// A cell; its [`fmt::Display`] is what people read.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cell {
    /// A name.
    Text(String),
    /// How many.
    Count(u64),
    /// A mean, with its 95 % interval where there is one.
    Value {
        /// The mean.
        value: f64,
        /// Its interval.
        interval: Option<[f64; 2]>,
        /// Digits after the point that are worth reading.
        decimals: usize,
        /// Runs that are not in the mean because it would be infinite: views identical.
        identical: usize,
    },
    /// Nothing but identical views, whose PSNR is infinite.
    Identical,
    /// How many of some runs succeeded.
    Share {
        /// Runs that did.
        right: usize,
        /// Runs.
        of: usize,
        /// Wilson's 95 % interval in percent.
        interval: [f64; 2],
    },
    /// What the paper says, and whether it was reached.
    Against {
        /// The paper's figure.
        paper: Option<f64>,
        /// What is to be reached.
        bar: f64,
        /// By how much it is missed, 0 if it is reached; `None` if it was not measured.
        missed_by: Option<f64>,
        /// Digits after the point.
        decimals: usize,
    },
    /// Asked for and not there.
    NotMeasured,
    /// Not asked for.
    Empty,
}

impl Cell {
    /// A text.
    pub fn text(text: impl Into<String>) -> Self {
        Cell::Text(text.into())
    }

    /// A number without an interval.
    pub fn number(value: f64, decimals: usize) -> Self {
        Cell::Value {
            value,
            interval: None,
            decimals,
            identical: 0,
        }
    }

    /// A mean, if it was measured.
    pub fn estimate(estimate: Option<Estimate>, decimals: usize) -> Self {
        let value = |estimate: Estimate| Cell::Value {
            value: estimate.mean,
            interval: estimate.interval,
            decimals,
            identical: 0,
        };
        estimate.map_or(Cell::NotMeasured, value)
    }

    /// A mean PSNR.
    pub fn psnr(psnr: Psnr) -> Self {
        match (Cell::estimate(psnr.differing, 2), psnr.identical) {
            (Cell::NotMeasured, 1..) => Cell::Identical,
            (
                Cell::Value {
                    value,
                    interval,
                    decimals,
                    ..
                },
                identical,
            ) => Cell::Value {
                value,
                interval,
                decimals,
                identical,
            },
            (cell, _) => cell,
        }
    }

    /// A share of runs, if there are any.
    pub fn share(share: Option<&Share>) -> Self {
        let cell = |share: &Share| Cell::Share {
            right: share.right,
            of: share.of,
            interval: share.interval.map(|end| 100.0 * end),
        };
        share.map_or(Cell::NotMeasured, cell)
    }

    /// Whether it was asked for and is not there.
    pub fn is_missing(&self) -> bool {
        matches!(self, Cell::NotMeasured)
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cell::Text(text) => f.write_str(text),
            Cell::Count(count) => write!(f, "{count}"),
            Cell::Value {
                value,
                interval,
                decimals,
                identical,
            } => {
                write!(f, "{value:.decimals$}")?;
                if let Some([low, high]) = interval {
                    write!(f, " ({low:.decimals$} to {high:.decimals$})")?;
                }
                match identical {
                    0 => Ok(()),
                    n => write!(f, ", {n} identical"),
                }
            }
            Cell::Identical => f.write_str("identical"),
            Cell::Share { right, of, interval } => {
                let [low, high] = interval;
                write!(f, "{right} of {of} ({low:.0} to {high:.0} %)")
            }
            Cell::Against {
                paper,
                bar,
                missed_by,
                decimals,
            } => {
                match paper {
                    Some(paper) if paper == bar => write!(f, "{paper:.decimals$}")?,
                    Some(paper) => write!(f, "{paper:.decimals$}, bar {bar:.decimals$}")?,
                    None => write!(f, "bar {bar:.decimals$}")?,
                }
                match missed_by {
                    None => Ok(()),
                    Some(0.0) => f.write_str(" ✓"),
                    // What rounds to nothing is missed all the same.
                    Some(missed) if *missed < 0.5 * 0.1f64.powi(*decimals as i32) => {
                        write!(f, " (missed by under {:.decimals$})", 0.1f64.powi(*decimals as i32))
                    }
                    Some(missed) => write!(f, " (missed by {missed:.decimals$})"),
                }
            }
            Cell::NotMeasured => f.write_str("not measured"),
            Cell::Empty => f.write_str("–"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn against(paper: Option<f64>, bar: f64, missed_by: Option<f64>) -> String {
        Cell::Against {
            paper,
            bar,
            missed_by,
            decimals: 2,
        }
        .to_string()
    }

    #[test]
    fn texts_of_cells() {
        let estimate = |interval| Estimate {
            mean: 99.637,
            interval,
            runs: 3,
        };
        assert_eq!(Cell::estimate(Some(estimate(None)), 2).to_string(), "99.64");
        let with = Cell::estimate(Some(estimate(Some([98.0, 100.0]))), 2);
        assert_eq!(with.to_string(), "99.64 (98.00 to 100.00)");
        assert_eq!(Cell::estimate(None, 2).to_string(), "not measured");
        let psnr = |differing, identical| Cell::psnr(Psnr { differing, identical }).to_string();
        assert_eq!(psnr(Some(estimate(None)), 1), "99.64, 1 identical");
        assert_eq!(psnr(None, 2), "identical");
        assert_eq!(psnr(None, 0), "not measured");
        let share = Share {
            right: 8,
            of: 10,
            interval: [0.490_162, 0.943_318],
        };
        assert_eq!(Cell::share(Some(&share)).to_string(), "8 of 10 (49 to 94 %)");
        assert_eq!(against(Some(99.64), 99.64, Some(0.0)), "99.64 ✓");
        assert_eq!(
            against(Some(99.64), 99.0, Some(0.42)),
            "99.64, bar 99.00 (missed by 0.42)"
        );
        assert_eq!(against(None, 99.0, Some(0.001)), "bar 99.00 (missed by under 0.01)");
        assert_eq!(against(Some(99.64), 99.64, None), "99.64");
    }
}
