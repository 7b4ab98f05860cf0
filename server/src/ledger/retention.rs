//! What of the ledger may go by age: a trait of its own beside [`super::Ledger`], which has it as a supertrait.
//!
//! Whatever is referenced stays: what an unfinished job reads, key files and the jobs that made them, evidence and the
//! jobs that left it, originals of registered assets.
use std::collections::HashSet;

use super::{ArtifactId, Result};

/// What was over before these times may go; nothing of a kind without one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Before {
    /// Uploads that were made, and last read by a job that ended, before.
    pub uploads: Option<i64>,
    /// Outputs of jobs that ended, and last read by one that did, before.
    pub outputs: Option<i64>,
    /// Jobs that ended before, with their outputs, once these are gone.
    pub jobs: Option<i64>,
}

/// How much went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expired {
    /// Artifacts that are marked as deleted now.
    pub artifacts: u64,
    /// Jobs that are gone.
    pub jobs: u64,
}

/// What the service keeps, and until when.
#[async_trait::async_trait]
pub trait Retention: Send + Sync + 'static {
    /// Marks as deleted what may go, and removes jobs of which nothing is left; at most `limit` of each kind at once.
    /// `abandoned_artifacts` tells of the artifacts, whose bytes go first.
    async fn expire(&self, before: Before, limit: u32) -> Result<Expired>;

    /// Paths of those of these artifacts that there is a row of, in whatever state.
    async fn known_paths(&self, ids: &[ArtifactId]) -> Result<HashSet<String>>;
}

/// Conditions of the statements, the same in both databases but for how they number their values. `a` is the artifact,
/// `j` the job; `{0}` is the time.
macro_rules! conditions {
    ($time:literal) => {
        /// An artifact that nobody has read since, and that nothing names for good.
        pub(in crate::ledger) const UNUSED: &str = concat!(
            "a.state = 3 AND NOT a.secret AND NOT a.evidence \
             AND NOT EXISTS (SELECT 1 FROM assets s WHERE s.artifact_id = a.id) \
             AND NOT EXISTS (SELECT 1 FROM job_inputs i JOIN jobs r ON r.id = i.job_id \
             WHERE i.artifact_id = a.id AND (r.state IN (1, 2) OR r.end_time >= ",
            $time,
            "))"
        );
        /// An upload of before.
        pub(in crate::ledger) const UPLOAD: &str = concat!("a.job_id IS NULL AND a.create_time < ", $time);
        /// A job of before.
        pub(in crate::ledger) const OVER: &str = concat!("j.state >= 3 AND j.end_time < ", $time);
    };
}

/// A job that neither made a key nor left evidence.
pub(in crate::ledger) const LEFT_NOTHING: &str = "NOT EXISTS (SELECT 1 FROM keys k WHERE k.job_id = j.id) \
     AND NOT EXISTS (SELECT 1 FROM artifacts e WHERE e.job_id = j.id AND e.state = 3 AND e.evidence)";
/// A job of whose outputs nothing is left, not even rows.
pub(in crate::ledger) const WITHOUT_OUTPUTS: &str = "NOT EXISTS (SELECT 1 FROM artifacts o WHERE o.job_id = j.id)";

/// As SQLite numbers values.
pub(in crate::ledger) mod sqlite {
    conditions!("?1");
}

/// As PostgreSQL numbers values.
pub(in crate::ledger) mod postgres {
    conditions!("$1");
}
