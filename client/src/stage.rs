//! How far a command is, which decides what an interrupt leaves behind.

/// How far a command is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// Nothing of it outlives the command.
    #[default]
    Nothing,
    /// A job is being created: nobody knows yet whether it is there.
    Creating,
    /// The job is waited for.
    Waiting {
        /// Its name.
        job: String,
        /// Whether an interrupt is to cancel it.
        cancel: bool,
    },
    /// The job is done, and what it made is being fetched.
    Fetching {
        /// Its name.
        job: String,
    },
}
