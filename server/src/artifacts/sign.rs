//! Addresses at which a store gives out an artifact itself, for a short time, to whoever has them.
use std::time::Duration;

use object_store::signer::Method;

use super::{ArtifactPath, ArtifactStore, StoreResult};

impl ArtifactStore {
    /// Whether the store has addresses of its own.
    pub fn can_sign(&self) -> bool {
        self.inner.signer.is_some()
    }

    /// An address for reading an artifact, good for so long; none where the store has none to give.
    pub async fn download_url(&self, path: &ArtifactPath, lifetime: Duration) -> StoreResult<Option<String>> {
        let Some(signer) = &self.inner.signer else {
            return Ok(None);
        };
        let url = self
            .answered(signer.signed_url(Method::GET, path.as_object_path(), lifetime))
            .await?;
        Ok(Some(url.into()))
    }
}
