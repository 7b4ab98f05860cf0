//! Everything that can go wrong with words and claims, by what happened.
use crate::limits::{MAX_BITS, VERSION};

/// Result of operations on words and claims.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen; texts name the field and the limit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A message would have no bits, or more than there is room for.
    #[error("bits: {bits} is outside 1 to {MAX_BITS}")]
    Length {
        /// The bits asked for.
        bits: usize,
    },
    /// Two things that are compared differ in their number of bits.
    #[error("{what} has {bits} bits, not {expected}")]
    OtherLength {
        /// What has the wrong length.
        what: String,
        /// Its bits.
        bits: u32,
        /// The bits that it should have.
        expected: u32,
    },
    /// A text is not a message in hexadecimal.
    #[error("message: {reason}")]
    Digits {
        /// What is wrong.
        reason: String,
    },
    /// A number does not fit the bits that it has.
    #[error("{field}: {value} is above {limit}")]
    TooLarge {
        /// The number's name.
        field: &'static str,
        /// The number.
        value: u64,
        /// The largest that fits.
        limit: u64,
    },
    /// A payload was packed by rules that are not known here.
    #[error("payload: version {version} is not {VERSION}")]
    UnknownVersion {
        /// The version found.
        version: u8,
    },
    /// Bytes that whiten are too few.
    #[error("{field}: {bytes} bytes are fewer than {least}")]
    TooShort {
        /// What they are.
        field: &'static str,
        /// Their number.
        bytes: usize,
        /// The fewest there may be.
        least: usize,
    },
    /// A false-positive rate is not one.
    #[error("rate: {rate} is not above 0 and below 1")]
    Rate {
        /// The rate asked for.
        rate: f64,
    },
    /// A count of what was tried contradicts what was handed over, or is too large to count.
    #[error("{field}: {reason}")]
    Hypotheses {
        /// The count's name.
        field: &'static str,
        /// What is wrong.
        reason: String,
    },
}
