//! What a job is to do, how far it is, and what came out of it.
//!
//! The three are the messages of the API ([`guardsplat_proto::v1`]) that a job is asked for and answered with, each of
//! the kind of its job. The database holds them encoded; only [`codec`](super::codec) knows of that.
use guardsplat_proto::v1;

pub use guardsplat_proto::v1::Progress;

use super::types::JobKind;

/// What a job is to do.
#[derive(Clone, Debug, PartialEq)]
pub enum JobSpec {
    /// Marks a scene.
    Embed(v1::EmbedSpec),
    /// Reads a suspect.
    Verify(v1::VerifySpec),
    /// Makes a key.
    CreateKey(v1::KeySpec),
}

impl JobSpec {
    /// The kind of the job.
    pub fn kind(&self) -> JobKind {
        match self {
            Self::Embed(_) => JobKind::Embed,
            Self::Verify(_) => JobKind::Verify,
            Self::CreateKey(_) => JobKind::CreateKey,
        }
    }
}

/// What came out of a job that succeeded.
#[derive(Clone, Debug, PartialEq)]
pub enum JobResult {
    /// A marked scene.
    Embed(v1::EmbedResult),
    /// What a suspect said.
    Verify(v1::VerifyResult),
    /// A key.
    CreateKey(v1::KeyResult),
}

impl JobResult {
    /// The kind of the job.
    pub fn kind(&self) -> JobKind {
        match self {
            Self::Embed(_) => JobKind::Embed,
            Self::Verify(_) => JobKind::Verify,
            Self::CreateKey(_) => JobKind::CreateKey,
        }
    }
}
