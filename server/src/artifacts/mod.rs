//! Where artifacts' bytes are: any number of writers and readers over an object store, by default a local folder.
//!
//! Nothing is visible under its path before all of it arrived and was found to be what was announced: bytes go to a
//! staged file, which is synced and then renamed. A writer that fails or is dropped leaves nothing. Which artifacts
//! there are is the ledger's business; the store only knows paths, and those are made of ids.
mod check;
mod error;
mod local;
mod path;
mod probe;
mod reader;
mod sealed;
mod writer;

use std::path::Path;
use std::sync::Arc;

use object_store::{ObjectStore, ObjectStoreExt};
use prost::bytes::Bytes;

pub use check::{Announced, Check};
pub use error::{StoreError, StoreResult};
pub use path::ArtifactPath;
pub use reader::Reader;
pub use sealed::MAX_SECRET_BYTES;
pub use writer::Writer;

/// Most bytes that one chunk has, in and out.
pub const CHUNK_BYTES: usize = 1 << 20;

/// The bytes of all artifacts.
#[derive(Clone, Debug)]
pub struct ArtifactStore {
    store: Arc<dyn ObjectStore>,
    folder: local::Folder,
    max_bytes: u64,
}

impl ArtifactStore {
    /// Opens the folder, which is made if it is missing, and removes what writers of a server that was killed left
    /// behind; so no other server may use it. No artifact may be longer than `max_bytes`.
    pub fn open(folder: &Path, max_bytes: u64) -> StoreResult<Self> {
        let (folder, store) = local::open(folder)?;
        Ok(Self {
            store: Arc::new(store),
            folder,
            max_bytes,
        })
    }

    /// Most bytes that an artifact may have.
    pub fn max_bytes(&self) -> u64 {
        self.max_bytes
    }

    /// Begins to write an artifact. An announced size over the limit is refused here, before any byte is sent.
    pub async fn write(&self, path: &ArtifactPath, announced: Announced) -> StoreResult<Writer> {
        let check = Check::new(announced, self.max_bytes)?;
        let upload = self.store.put_multipart(path.as_object_path()).await?;
        Ok(Writer::new(upload, check))
    }

    /// Begins to read an artifact from byte `offset`, which may be its end.
    pub async fn read(&self, path: &ArtifactPath, offset: u64) -> StoreResult<Reader> {
        Reader::open(self.store.clone(), path.as_object_path().clone(), offset).await
    }

    /// The first bytes of an artifact, at most `most`, and its length.
    pub async fn head(&self, path: &ArtifactPath, most: usize) -> StoreResult<(Bytes, u64)> {
        let mut reader = self.read(path, 0).await?;
        let head = reader.up_to(most).await?;
        Ok((head.unwrap_or_default(), reader.size()))
    }

    /// Deletes an artifact. One that is not there is none the less deleted.
    pub async fn delete(&self, path: &ArtifactPath) -> StoreResult<()> {
        match self.store.delete(path.as_object_path()).await {
            Ok(()) => self.folder.sync_after_delete(path.as_object_path()).await,
            Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests;
