//! What a job is to do, how far it is, and what came out of it.
//!
//! The three are the messages of the API ([`guardsplat_proto::v1`]) that a job is asked for and answered with, each of
//! the kind of its job; but for the order of a key, whose seed is a secret. The database holds them encoded; only [`codec`](super::codec) knows of that.
use std::fmt;

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
    CreateKey(KeyOrder),
}

/// A key to make.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyOrder {
    /// Bits of its messages.
    pub bits: u32,
    /// What it is made from, where it is to be reproducible.
    pub seed: Option<Seed>,
}

/// The seed of a key, which is as secret as the key.
#[derive(Clone, PartialEq)]
pub enum Seed {
    /// As it was told. Nothing is kept like that any more.
    Open(u64),
    /// Under the master key, for its job.
    Sealed(Vec<u8>),
}

impl fmt::Debug for Seed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Open(_) => "Open([REDACTED])",
            Self::Sealed(_) => "Sealed(..)",
        })
    }
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
