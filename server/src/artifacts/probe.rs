//! Whether the store takes bytes and gives them back.
use object_store::path::Path;
use object_store::{ObjectStoreExt, PutPayload};
use uuid::Uuid;

use super::{ArtifactStore, StoreResult};

/// Where trials lie; no artifact has a path like this.
const FOLDER: &str = "trials";

impl ArtifactStore {
    /// Writes a few bytes, reads them, and deletes them.
    pub async fn check(&self) -> StoreResult<()> {
        let id = Uuid::now_v7().to_string();
        let path = Path::from_iter([FOLDER, &id]);
        self.store.put(&path, PutPayload::from(id.clone())).await?;
        let read = async { self.store.get(&path).await?.bytes().await }.await;
        // Also when it can't be read.
        self.store.delete(&path).await?;
        let read = read?;
        if read.as_ref() != id.as_bytes() {
            return Err(super::StoreError::Gone { path: path.to_string() });
        }
        Ok(())
    }
}
