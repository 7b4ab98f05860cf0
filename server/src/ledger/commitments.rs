//! The log of commitments, which only grows, and the key that it is signed with.
use guardsplat_commitment::Signed;

use super::Result;
use super::registry::CommitmentId;

/// The key that commitments are signed with, sealed.
#[derive(Clone, Debug, PartialEq)]
pub struct SealedSigningKey {
    /// The half that signatures are checked with.
    pub public_key: [u8; 32],
    /// The seed of the other half, sealed.
    pub sealed: Vec<u8>,
}

/// The chain of signed commitments to assets.
#[async_trait::async_trait]
pub trait CommitmentLog: Send + Sync + 'static {
    /// The key that commitments are signed with; none before the first start.
    async fn signing_key(&self) -> Result<Option<SealedSigningKey>>;

    /// Keeps a signing key for good, unless there is one already; returns the one that is kept.
    async fn keep_signing_key(&self, new: SealedSigningKey, now: i64) -> Result<SealedSigningKey>;

    /// One commitment.
    async fn get_commitment(&self, id: CommitmentId) -> Result<Option<Signed>>;

    /// Commitments to assets of a project in the order of the chain, those behind the one at place `after`. The chain is
    /// one for all projects, so there may be others in between.
    async fn list_commitments(&self, project: &str, after: i64, limit: u32) -> Result<Vec<Signed>>;

    /// The last commitment of the chain that is to an asset of a project.
    async fn head(&self, project: &str) -> Result<Option<Signed>>;
}
