//! How marks are judged: real attacks on pictures, statistics, steganalysis, and reports of what was measured.
//!
//! Knows pictures and numbers, neither scenes nor CLIP: the worker makes the marks, this crate says what they are worth.
pub mod attack;
pub mod error;
pub mod report;
pub mod statistics;
pub mod steganalysis;

pub use error::{Error, Result};
