//! Reads one artifact, chunk by chunk, from any byte on.
use std::sync::Arc;

use futures::stream::{BoxStream, StreamExt, try_unfold};
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt};
use prost::bytes::Bytes;

use super::{CHUNK_BYTES, StoreError, StoreResult};

/// An artifact that is being read.
pub struct Reader {
    store: Arc<dyn ObjectStore>,
    path: Path,
    offset: u64,
    size: u64,
}

impl Reader {
    pub(super) async fn open(store: Arc<dyn ObjectStore>, path: Path, offset: u64) -> StoreResult<Self> {
        let size = store.head(&path).await?.size;
        if offset > size {
            return Err(StoreError::BadOffset { offset, size });
        }
        Ok(Self {
            store,
            path,
            offset,
            size,
        })
    }

    /// Length of the whole artifact in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The next bytes, at most [`CHUNK_BYTES`]; nothing at the end. They are read when they are asked for, so a slow
    /// reader holds one chunk, whatever the artifact's length.
    pub async fn chunk(&mut self) -> StoreResult<Option<Bytes>> {
        self.up_to(CHUNK_BYTES).await
    }

    /// As [`Self::chunk`], at most `most` bytes.
    pub(super) async fn up_to(&mut self, most: usize) -> StoreResult<Option<Bytes>> {
        if self.offset == self.size {
            return Ok(None);
        }
        let end = self.size.min(self.offset + most as u64);
        let chunk = self.store.get_range(&self.path, self.offset..end).await?;
        self.offset = end;
        Ok(Some(chunk))
    }

    /// All chunks as a stream.
    pub fn into_stream(self) -> BoxStream<'static, StoreResult<Bytes>> {
        try_unfold(self, async |mut reader| {
            Ok(reader.chunk().await?.map(|chunk| (chunk, reader)))
        })
        .boxed()
    }
}
