//! Limits of what records may hold, so that a store never keeps a number that JSON cannot carry or a table cannot use.
use crate::error::{Error, Result};

pub(super) fn bad<T>(field: &'static str, reason: impl Into<String>) -> Result<T> {
    Err(Error::BadOption {
        field,
        reason: reason.into(),
    })
}

/// A finite number of at least 0.
pub(super) fn amount(field: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    bad(field, format!("{value} is not a finite number of at least 0"))
}

/// A finite number.
pub(super) fn finite(field: &'static str, value: f64) -> Result<()> {
    if value.is_finite() {
        return Ok(());
    }
    bad(field, format!("{value} is not a finite number"))
}

/// A number within 0..=1.
pub(super) fn share(field: &'static str, value: f64) -> Result<()> {
    if (0.0..=1.0).contains(&value) {
        return Ok(());
    }
    bad(field, format!("{value} is not within 0..=1"))
}

/// A check of what may be missing.
pub(super) fn maybe(field: &'static str, value: Option<f64>, check: fn(&'static str, f64) -> Result<()>) -> Result<()> {
    value.map_or(Ok(()), |value| check(field, value))
}

/// A text that names something.
pub(super) fn named(field: &'static str, text: &str) -> Result<()> {
    if text.trim().is_empty() {
        return bad(field, "is empty");
    }
    Ok(())
}
