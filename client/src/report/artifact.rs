//! Artifacts.
use guardsplat_proto::v1::Artifact;
use serde::Serialize;

use super::text::{some, time};

/// What is known of an artifact.
#[derive(Debug, Serialize)]
pub struct ArtifactReport {
    name: String,
    display_name: String,
    size_bytes: i64,
    sha256: String,
    create_time: Option<String>,
    /// The job that made it.
    job: Option<String>,
}

impl From<&Artifact> for ArtifactReport {
    fn from(artifact: &Artifact) -> Self {
        Self {
            name: artifact.name.clone(),
            display_name: artifact.display_name.clone(),
            size_bytes: artifact.size_bytes,
            sha256: artifact.sha256.clone(),
            create_time: time(artifact.create_time),
            job: some(&artifact.job),
        }
    }
}
