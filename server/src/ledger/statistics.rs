//! How much there is to do, and how much a project takes.
use super::Result;
use super::types::{FailureReason, JobKind};

/// How many jobs there are to do, being done, and given up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Queued jobs by kind; a kind of which none is queued may be missing.
    pub queued: Vec<Waiting>,
    /// Running jobs by kind; a kind of which none runs may be missing.
    pub running: Vec<Running>,
    /// Failed jobs by kind and reason.
    pub failed: Vec<(JobKind, FailureReason, u64)>,
}

/// The queued jobs of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waiting {
    /// What they do.
    pub kind: JobKind,
    /// How many they are.
    pub count: u64,
    /// Since when the first of them could have been given to a worker; it may lie ahead, after a failed attempt.
    pub since: i64,
}

/// The running jobs of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Running {
    /// What they do.
    pub kind: JobKind,
    /// How many they are.
    pub count: u64,
    /// Bytes of memory that they probably take together, as far as their scenes told.
    pub memory: u64,
}

/// What a project takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Its queued jobs.
    pub queued_jobs: u64,
    /// Bytes of its artifacts that are all there, published or not, secret ones too.
    pub artifact_bytes: u64,
    /// Bytes of uploads that are begun and go to the store by themselves.
    pub reserved_bytes: u64,
}

impl Usage {
    /// All bytes that count.
    pub fn bytes(&self) -> u64 {
        self.artifact_bytes.saturating_add(self.reserved_bytes)
    }
}

/// Numbers for operators, and for limits on what a project takes.
#[async_trait::async_trait]
pub trait Statistics: Send + Sync + 'static {
    /// How many jobs there are, of all projects.
    async fn tally(&self) -> Result<Tally>;

    /// What a project takes now.
    async fn usage(&self, project: &str) -> Result<Usage>;
}

/// A number of rows.
pub(super) fn count(value: i64) -> u64 {
    u64::try_from(value).unwrap_or_default()
}
