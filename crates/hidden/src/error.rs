//! Everything that can go wrong with the decoder, by what happened.

/// Result of what this crate does.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen; texts name the field and the limit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is outside its limits.
    #[error("{field} is {value}, must be within {low} and {high}")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// What it is.
        value: f64,
        /// The smallest value that is accepted.
        low: f64,
        /// The largest value that is accepted.
        high: f64,
    },
    /// Pictures have a shape that cannot be used.
    #[error("pictures have shape {shape:?}, must be {expected}")]
    BadShape {
        /// Their shape.
        shape: [usize; 4],
        /// What is accepted.
        expected: &'static str,
    },
    /// The source of pictures failed.
    #[error("no pictures: {reason}")]
    NoPictures {
        /// What it said.
        reason: String,
    },
    /// Weights do not fit this network, or their file is damaged.
    #[error("{name}: {reason}")]
    BadWeights {
        /// The file, or what stands for it.
        name: String,
        /// What is wrong, with the tensor's name where there is one.
        reason: String,
    },
    /// The distortions between encoder and decoder are out of range.
    #[error("distortion: {0}")]
    Distortion(#[from] guardsplat_distortion::Error),
    /// A loss or a weight stopped being a number.
    #[error("{what} is {value} after {step} steps")]
    NotFinite {
        /// Of what.
        what: &'static str,
        /// The value.
        value: f32,
        /// Optimiser steps taken.
        step: usize,
    },
    /// Values could not be read back from the device.
    #[error("device: {reason}")]
    Device {
        /// What it said.
        reason: String,
    },
    /// The caller asked for an end.
    #[error("stopped")]
    Stopped,
}

/// Fails unless `value` is a number within `low` and `high`.
pub(crate) fn within(field: &'static str, value: f64, low: f64, high: f64) -> Result<()> {
    // Written so that NaN fails, too.
    if value >= low && value <= high {
        return Ok(());
    }
    Err(Error::OutOfRange {
        field,
        value,
        low,
        high,
    })
}

/// The values of a tensor, on the host.
pub(crate) fn host<const D: usize>(tensor: burn::tensor::Tensor<D>) -> Result<Vec<f32>> {
    tensor
        .try_into_vec_as::<f32>()
        .map_err(|e| Error::Device { reason: e.to_string() })
}
