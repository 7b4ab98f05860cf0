//! What can be wrong with settings.
/// What is wrong, with the setting and the limit.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// A file that can't be read, a setting that is unknown, or a value of another kind. The text names it, and where
    /// it was set.
    #[error("settings: {0}")]
    Unreadable(String),
    /// A setting outside its limits.
    #[error("setting {field}: {value} is not between {least} and {most}")]
    OutOfRange {
        /// The setting.
        field: &'static str,
        /// Its value.
        value: u64,
        /// Least value.
        least: u64,
        /// Greatest value.
        most: u64,
    },
    /// A setting that is wrong in another way.
    #[error("setting {field}: {reason}")]
    Invalid {
        /// The setting.
        field: &'static str,
        /// What is wrong.
        reason: String,
    },
}
