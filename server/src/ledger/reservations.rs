//! Bytes that a project has reserved for uploads which go to the store by themselves.
use super::{ArtifactId, Result};

/// Bytes of an upload that is begun.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UploadReservation {
    /// Of the artifact to be.
    pub id: ArtifactId,
    /// Whose bytes they are.
    pub project: String,
    /// How many.
    pub size: i64,
    /// When nobody can send any more.
    pub address_end: i64,
    /// When what was sent goes, and the bytes are given back.
    pub end_time: i64,
}

/// What is reserved. `create_artifact` gives back what was reserved for the artifact.
#[async_trait::async_trait]
pub trait UploadReservations: Send + Sync + 'static {
    /// Reserves bytes, if the project then has at most `limit` together with its artifacts; whether it does. Two calls at
    /// once never go over the limit together.
    async fn reserve_upload(&self, new: UploadReservation, limit: u64) -> Result<bool>;

    /// Whether anything is reserved for this artifact.
    async fn is_reserved(&self, id: ArtifactId) -> Result<bool>;

    /// Has a reservation end with its address, or where that has ended, at once: what was sent is not wanted.
    async fn end_with_address(&self, id: ArtifactId) -> Result<()>;

    /// Reservations that have ended by now, at most so many: delete what was sent, then give back the bytes.
    async fn ended_reservations(&self, now: i64, limit: u32) -> Result<Vec<ArtifactId>>;

    /// Gives back the bytes.
    async fn release_upload(&self, id: ArtifactId) -> Result<()>;
}
