//! Reads one artifact, chunk by chunk, from any byte on.
use futures::stream::{BoxStream, StreamExt, try_unfold};
use object_store::ObjectStoreExt;
use object_store::path::Path;
use prost::bytes::Bytes;

use super::{ArtifactStore, CHUNK_BYTES, StoreError, StoreResult};

/// An artifact that is being read.
pub struct Reader {
    store: ArtifactStore,
    path: Path,
    offset: u64,
    size: u64,
    /// Bytes that were asked for together with those before.
    ahead: Bytes,
}

impl Reader {
    pub(super) async fn open(store: ArtifactStore, path: Path, offset: u64) -> StoreResult<Self> {
        let size = store.size_of(&path).await?;
        if offset > size {
            return Err(StoreError::BadOffset { offset, size });
        }
        Ok(Self {
            store,
            path,
            offset,
            size,
            ahead: Bytes::new(),
        })
    }

    /// Length of the whole artifact in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The next bytes, at most [`CHUNK_BYTES`]; nothing at the end. They are read when they are asked for, so a slow
    /// reader holds one chunk, or what one request to a service brings, whatever the artifact's length.
    pub async fn chunk(&mut self) -> StoreResult<Option<Bytes>> {
        if self.ahead.is_empty() {
            let window = self.store.window();
            self.ahead = self.up_to(window).await?.unwrap_or_default();
        }
        let chunk = self.ahead.split_to(self.ahead.len().min(CHUNK_BYTES));
        Ok(Some(chunk).filter(|chunk| !chunk.is_empty()))
    }

    /// The next bytes in one request, at most `most`.
    pub(super) async fn up_to(&mut self, most: usize) -> StoreResult<Option<Bytes>> {
        if self.offset == self.size {
            return Ok(None);
        }
        let range = self.offset..self.size.min(self.offset + most as u64);
        let wanted = range.end - range.start;
        let read = self.store.objects().get_range(&self.path, range.clone());
        let bytes = self.store.answered(read).await?;
        if bytes.len() as u64 != wanted {
            return Err(StoreError::Short {
                path: self.path.to_string(),
                wanted,
                read: bytes.len() as u64,
            });
        }
        self.offset = range.end;
        Ok(Some(bytes))
    }

    /// All chunks as a stream.
    pub fn into_stream(self) -> BoxStream<'static, StoreResult<Bytes>> {
        try_unfold(self, async |mut reader| {
            Ok(reader.chunk().await?.map(|chunk| (chunk, reader)))
        })
        .boxed()
    }
}
