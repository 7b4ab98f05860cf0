//! Artifacts: what is known of the files in the store.
use super::Result;
use super::types::{ArtifactId, ArtifactRow, NewArtifact};

/// The artifacts of all projects; their bytes are in the store.
#[async_trait::async_trait]
pub trait ArtifactLedger: Send + Sync + 'static {
    /// Announces an artifact whose bytes are about to be stored at `path`.
    ///
    /// # Errors
    /// For an output `NotFound` and `LeaseLost`.
    async fn create_artifact(&self, new: NewArtifact, now: i64) -> Result<ArtifactRow>;

    /// All bytes are stored. An upload becomes visible; an output (which needs the token that announced it) becomes
    /// one that `complete` may publish.
    ///
    /// # Errors
    /// `NotFound` when it isn't there or has been collected as abandoned; `LeaseLost`.
    async fn artifact_ready(&self, id: ArtifactId, token: Option<&str>, now: i64) -> Result<ArtifactRow>;

    /// A visible artifact; never a secret one.
    async fn get_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>>;

    /// Any artifact, for the server itself.
    async fn get_any_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>>;

    /// Whether a running job reads this artifact.
    async fn is_being_read(&self, artifact: ArtifactId) -> Result<bool>;

    /// Whether an asset was registered from this artifact.
    async fn is_original(&self, artifact: ArtifactId) -> Result<bool>;

    /// Hides an artifact for good. Its bytes may go now; until `forget_artifact` it is among the abandoned ones.
    ///
    /// # Errors
    /// `NotFound`, also for secret artifacts; `InUse` while a queued or running job needs it.
    async fn delete_artifact(&self, id: ArtifactId, now: i64) -> Result<()>;

    /// Marks as deleted, and returns with those already deleted, artifacts that nobody can want any more: uploads that
    /// never became ready, and outputs of attempts that are over, created before `older_than`. Delete the bytes, then
    /// forget the row; or put it off, if they can't be.
    async fn abandoned_artifacts(&self, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>>;

    /// Puts a deleted artifact, whose bytes could not be deleted, behind all others that are to be.
    async fn put_off_artifact(&self, id: ArtifactId, now: i64) -> Result<()>;

    /// Removes the row of a deleted artifact whose bytes are gone.
    async fn forget_artifact(&self, id: ArtifactId) -> Result<()>;
}
