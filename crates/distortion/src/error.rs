//! Everything that can go wrong with distortions, by what happened.
use std::path::PathBuf;

/// Result of what this crate does.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen; texts name the field and the limit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No distortion has this name.
    #[error("unknown distortion {name:?}; known are {known}")]
    UnknownKind {
        /// The name.
        name: String,
        /// The names that exist, with commas between them.
        known: String,
    },
    /// A number is outside its limits.
    #[error("{field} is {value}, must be within {low} and {high}")]
    OutOfRange {
        /// The field.
        field: String,
        /// What it is.
        value: f64,
        /// The smallest value that is accepted.
        low: f64,
        /// The largest value that is accepted.
        high: f64,
    },
    /// The lower end of a range is above its upper end.
    #[error("{field} goes from {low} to {high}, the first must not be above the second")]
    Reversed {
        /// The field.
        field: String,
        /// The first number.
        low: f64,
        /// The second number.
        high: f64,
    },
    /// There is not one draw for each picture.
    #[error("{draws} draws for {pictures} pictures, there must be one for each")]
    WrongDraws {
        /// How many draws there are.
        draws: usize,
        /// How many pictures there are.
        pictures: usize,
    },
    /// The tensor does not hold colour pictures.
    #[error("pictures have shape {shape:?}, must be [b, 3, h, w] with h and w at least 1")]
    BadShape {
        /// Its shape.
        shape: [usize; 4],
    },
    /// Reading a file failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Weights of the learned codec do not fit.
    #[error("{name}: {reason}")]
    BadWeights {
        /// The file.
        name: String,
        /// What is wrong, with the tensor's name.
        reason: String,
    },
}

/// Fails unless `value` is a number within `low` and `high`.
pub(crate) fn within(field: &str, value: f64, low: f64, high: f64) -> Result<()> {
    // Written so that NaN fails, too.
    if value >= low && value <= high {
        return Ok(());
    }
    Err(Error::OutOfRange {
        field: field.into(),
        value,
        low,
        high,
    })
}

/// Fails unless both ends of a range are within `low` and `high` and in order.
pub(crate) fn range_within(field: &str, [from, to]: [f64; 2], low: f64, high: f64) -> Result<()> {
    within(field, from, low, high)?;
    within(field, to, low, high)?;
    if from <= to {
        return Ok(());
    }
    Err(Error::Reversed {
        field: field.into(),
        low: from,
        high: to,
    })
}
