//! Content credentials of marked scenes: which sidecars there are of a mark.
use super::Result;
use super::registry::AssetId;
use super::types::{ArtifactId, JobId, KeyId};

/// What a scene was marked with, under a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mark {
    /// The word of an asset.
    Asset(AssetId),
    /// A message, in the one spelling of its hexadecimal digits.
    Message(String),
}

/// Credentials that an attempt made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewCredentials {
    /// The sidecar, one of the outputs.
    pub artifact: ArtifactId,
    /// What the scene that they are of was marked with.
    pub mark: Mark,
    /// The identifier of the active manifest.
    pub manifest: String,
    /// What names the mark, base64.
    pub soft_binding: String,
    /// Whether a test certificate signed.
    pub test_certificate: bool,
}

/// Credentials that are there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CredentialsRow {
    /// The sidecar.
    pub artifact: ArtifactId,
    /// Where the store has its bytes.
    pub path: String,
    /// How many these are.
    pub size: i64,
    /// The job that made it.
    pub job: JobId,
    /// The identifier of the active manifest.
    pub manifest: String,
    /// What names the mark, base64.
    pub soft_binding: String,
    /// Whether a test certificate signed.
    pub test_certificate: bool,
}

/// Which credentials are wanted; newest first, of one project.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CredentialsOf {
    /// Of scenes that were marked so.
    Mark(KeyId, Mark),
    /// That have this value of a soft binding.
    Binding(String),
    /// With this active manifest.
    Manifest(String),
}

/// Credentials of marked scenes. They are made with the completion of their job, and go with their artifact.
#[async_trait::async_trait]
pub trait CredentialsLedger: Send + Sync + 'static {
    /// Those that are wanted of a project, newest first, at most so many.
    async fn find_credentials(&self, project: &str, of: &CredentialsOf, limit: u32) -> Result<Vec<CredentialsRow>>;
}
