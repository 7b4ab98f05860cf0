//! The generation that a store names, and whether two ledgers quarrel about it.
use object_store::path::Path;
use object_store::{ObjectStoreExt, PutPayload};
use uuid::Uuid;

use super::{ArtifactStore, StoreError, StoreResult};

/// Where the generation stands.
const GENERATION: &str = "generation";
/// What is there while two ledgers take the store for theirs.
const CONTESTED: &str = "contested";

impl ArtifactStore {
    /// The generation that the store is in; none in a store that was never used.
    pub async fn generation(&self) -> StoreResult<Option<Uuid>> {
        let Some(bytes) = self.small(GENERATION).await? else {
            return Ok(None);
        };
        let text = String::from_utf8_lossy(&bytes);
        // What nobody of us wrote is no generation of ours.
        Ok(Some(Uuid::try_parse(text.trim()).unwrap_or_default()))
    }

    /// Puts the store into a generation.
    pub async fn set_generation(&self, generation: Uuid) -> StoreResult<()> {
        self.put_small(GENERATION, generation.to_string()).await
    }

    /// Whether two ledgers take the store for theirs.
    pub async fn is_contested(&self) -> StoreResult<bool> {
        Ok(self.small(CONTESTED).await?.is_some())
    }

    /// Has everybody know that two ledgers take the store for theirs.
    pub async fn contest(&self) -> StoreResult<()> {
        let text = "Two ledgers take these artifacts for theirs. Stop the servers of the one that is a copy, and say \
                    `guardsplat-server store take-over` with the settings of the other.\n";
        self.put_small(CONTESTED, text.to_owned()).await
    }

    /// Has everybody know that they do no longer.
    pub async fn settle(&self) -> StoreResult<()> {
        match self.answered(self.objects().delete(&Path::from(CONTESTED))).await {
            Ok(()) | Err(StoreError::Gone { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    async fn small(&self, name: &str) -> StoreResult<Option<Vec<u8>>> {
        match self.answered(self.read_small(&Path::from(name))).await {
            Ok(bytes) => Ok(Some(bytes)),
            Err(StoreError::Gone { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    async fn put_small(&self, name: &str, text: String) -> StoreResult<()> {
        let path = Path::from(name);
        let put = self.objects().put(&path, PutPayload::from(text));
        self.written(put).await.map(|_| ())
    }
}
