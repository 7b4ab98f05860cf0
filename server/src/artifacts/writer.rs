//! Writes one artifact, chunk by chunk.
use object_store::{MultipartUpload, WriteMultipart};
use prost::bytes::Bytes;

use super::{Announced, CHUNK_BYTES, Check, StoreResult};

/// Parts that may be on their way to the disk while the next chunk is awaited. Bounds the memory of a slow disk.
const PARTS_UNDER_WAY: usize = 2;

/// An artifact that is being written. Nothing is kept unless [`Writer::finish`] succeeds: dropping the writer, as
/// happens when a stream breaks off, removes what was written.
#[derive(Debug)]
pub struct Writer {
    parts: WriteMultipart,
    check: Check,
}

impl Writer {
    pub(super) fn new(upload: Box<dyn MultipartUpload>, check: Check) -> Self {
        Self {
            parts: WriteMultipart::new_with_chunk_size(upload, CHUNK_BYTES),
            check,
        }
    }

    /// Takes the next bytes. After an error the writer is of no more use.
    pub async fn chunk(&mut self, chunk: impl Into<Bytes>) -> StoreResult<()> {
        let chunk = chunk.into();
        self.check.chunk(&chunk)?;
        self.parts.wait_for_capacity(PARTS_UNDER_WAY).await?;
        self.parts.put(chunk);
        Ok(())
    }

    /// Publishes the artifact if it is what was announced, and returns once it would survive a power cut.
    pub async fn finish(self) -> StoreResult<Announced> {
        match self.check.finish() {
            Ok(announced) => {
                self.parts.finish().await?;
                Ok(announced)
            }
            Err(error) => {
                // What was announced wrongly is what the sender should hear of.
                if let Err(error) = self.parts.abort().await {
                    tracing::warn!(%error, "an upload could not be removed");
                }
                Err(error)
            }
        }
    }

    /// Gives up, and returns once nothing is left.
    pub async fn abort(self) -> StoreResult<()> {
        Ok(self.parts.abort().await?)
    }
}
