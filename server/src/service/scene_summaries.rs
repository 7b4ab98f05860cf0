//! What scenes take, remembered: the beginning of an artifact is read from the store once, however many jobs ask.
use std::path::Path;

use guardsplat_scene::{HEAD, Summary};
use quick_cache::sync::Cache;

use crate::artifacts::{ArtifactPath, StoreError};
use crate::error::Result;
use crate::ledger::ArtifactId;
use crate::service::Service;
use crate::service::names::ResourceKind;

/// Artifacts that are remembered, a hundred bytes each.
const REMEMBERED: usize = 4096;

/// Summaries of artifacts, which never change; none for one that is no scene.
pub struct SceneSummaries(Cache<ArtifactId, Option<Summary>>);

impl Default for SceneSummaries {
    fn default() -> Self {
        Self(Cache::new(REMEMBERED))
    }
}

impl Service {
    /// What the first bytes of an artifact tell of a scene. What is none, or not there any more, is for others to
    /// refuse, who know more of it. That the artifact is the project's is looked up every time.
    pub(crate) async fn summary(&self, project: &str, id: ArtifactId) -> Result<Option<Summary>> {
        let Some(row) = self.find_artifact(project, id).await? else {
            return Ok(None);
        };
        let known = &self.shared.summaries.0;
        if let Some(summary) = known.get(&id) {
            return Ok(summary);
        }
        let path = ArtifactPath::parse(&row.path)?;
        let (head, size) = match self.store().head(&path, HEAD).await {
            Err(StoreError::Gone { .. }) => return Ok(None),
            head => head?,
        };
        let name = ResourceKind::Artifact.name(id);
        let summary = guardsplat_scene::summary(Path::new(&name), &head, size).unwrap_or_else(|refusal| {
            tracing::debug!(%refusal, "not known to be a scene");
            None
        });
        known.insert(id, summary);
        Ok(summary)
    }
}
