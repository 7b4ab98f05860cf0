//! How much logits look like those of a mark, whatever it says.
//!
//! A mark pushes all bits of a picture away from 0, about equally far. Logits of an unmarked picture, or of one whose tones
//! are wrong, spread around 0, and few are large. Nothing here knows a message, so that a reading may be chosen by it
//! without being paid for.
use crate::extract::photometric::ToneChange;

/// How unlikely changes are: a change as large as these, in logarithms, costs what [`COST`] says.
const COMMON: [f32; 6] = [0.4, 0.4, 0.4, 0.35, 0.35, 0.35];
/// How much tints cost: channels that differ by this much.
const TINT: f32 = 0.1;
/// What a common change costs, in logarithms of the size of logits.
const COST: f64 = 0.02;

/// The logarithm of a mean size of logits, in which large ones count less than their squares would; not a number where
/// one isn't.
pub(super) fn of_logits(logits: &[f32]) -> f64 {
    let mean = logits.iter().map(|v| f64::from(v.abs())).sum::<f64>() / logits.len().max(1) as f64;
    match mean > 0.0 {
        true => mean.ln(),
        false => f64::NEG_INFINITY,
    }
}

/// What a change must gain to be believed.
pub(super) fn cost(change: &ToneChange) -> f64 {
    let square = |v: f32| f64::from(v * v);
    let common: f64 = change.logs.iter().zip(COMMON).map(|(v, most)| square(v / most)).sum();
    let mean = change.logs[..3].iter().sum::<f32>() / 3.0;
    let tint: f64 = change.logs[..3].iter().map(|v| square((v - mean) / TINT)).sum();
    COST * (common + tint)
}
