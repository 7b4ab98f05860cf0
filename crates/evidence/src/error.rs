//! Everything that can go wrong with reports, by what happened.

/// Result of operations on reports.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One variant per thing that can happen; texts name the field and the limit.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A document or a picture is larger than is read.
    #[error("{what} has {bytes} bytes, at most {limit} are read")]
    TooLarge {
        /// What is too large.
        what: String,
        /// How large it is.
        bytes: u64,
        /// How large it may be.
        limit: u64,
    },
    /// It is not JSON, or not the JSON of a report.
    #[error("not a report: {0}")]
    NotAReport(String),
    /// It says that it is a report, and has parts that no report has, or lacks some.
    #[error("malformed report: {0}")]
    Malformed(String),
    /// It is a report of a version that this program does not know.
    #[error("the report has version {found}, this program reads versions up to {known}: use a newer one")]
    UnknownVersion {
        /// What the report says.
        found: u64,
        /// The newest that can be read.
        known: u32,
    },
    /// A field has a value that it can't have.
    #[error("{field}: {reason}")]
    BadField {
        /// Where, as in `verification.decision.p_value`.
        field: String,
        /// What is wrong, with the limit.
        reason: String,
    },
    /// It is not a PNG, or not one that is shown.
    #[error("the picture is no PNG that can be shown: {0}")]
    BadPicture(String),
}

impl Error {
    /// An [`Error::BadField`].
    pub(crate) fn field(field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::BadField {
            field: field.into(),
            reason: reason.into(),
        }
    }
}
