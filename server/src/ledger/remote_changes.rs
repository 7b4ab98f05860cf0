//! What a server hears of changes that others made to a ledger that they share.
use super::types::JobId;

/// A change that another server made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RemoteChange {
    /// A job has changed.
    Job {
        /// Which.
        id: JobId,
        /// It can be given to a worker now, or soon.
        queue_grew: bool,
        /// Other queued jobs have other positions now.
        queue_moved: bool,
    },
    /// Some changes were not heard of: anything may have changed.
    Anything,
}
