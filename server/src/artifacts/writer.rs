//! Writes one artifact, chunk by chunk.
use object_store::path::Path;
use object_store::{ObjectStoreExt, PutPayloadMut, WriteMultipart};
use prost::bytes::Bytes;
use tokio::runtime::Handle;

use super::{Announced, ArtifactStore, Check, StoreResult};

/// Parts that may be on their way to the store while the next chunk is awaited. Bounds the memory of a slow one.
const PARTS_UNDER_WAY: usize = 2;

/// An artifact that is being written. Nothing is kept unless [`Writer::finish`] succeeds: dropping the writer, as
/// happens when a stream breaks off, removes what was written.
pub struct Writer {
    store: ArtifactStore,
    path: Path,
    bytes: Sink,
    check: Check,
}

/// Where the bytes go meanwhile.
enum Sink {
    /// A part after the other, which the store keeps apart until they are said to be all.
    Parts(Parts),
    /// So few that they are sent at once, when all are there.
    Whole(PutPayloadMut),
}

impl Writer {
    pub(super) async fn begin(
        store: ArtifactStore,
        path: Path,
        announced: Announced,
        check: Check,
    ) -> StoreResult<Self> {
        let bytes = match store.part_bytes(announced.size) {
            Some(part) => {
                let upload = store.answered(store.objects().put_multipart(&path)).await?;
                Sink::Parts(Parts {
                    parts: Some(WriteMultipart::new_with_chunk_size(upload, part)),
                    remote: store.is_remote(),
                })
            }
            None => Sink::Whole(PutPayloadMut::new()),
        };
        Ok(Self {
            store,
            path,
            bytes,
            check,
        })
    }

    /// Takes the next bytes. After an error the writer is of no more use.
    pub async fn chunk(&mut self, chunk: impl Into<Bytes>) -> StoreResult<()> {
        let chunk = chunk.into();
        self.check.chunk(&chunk)?;
        match &mut self.bytes {
            Sink::Parts(Parts { parts: Some(parts), .. }) => {
                parts.wait_for_capacity(PARTS_UNDER_WAY).await?;
                parts.put(chunk);
            }
            // Only its end takes the parts.
            Sink::Parts(Parts { parts: None, .. }) => {}
            Sink::Whole(all) => all.push(chunk),
        }
        Ok(())
    }

    /// Publishes the artifact if it is what was announced, and returns once it would survive a power cut.
    pub async fn finish(self) -> StoreResult<Announced> {
        let Self {
            store,
            path,
            bytes,
            check,
        } = self;
        let announced = match check.finish() {
            Ok(announced) => announced,
            Err(error) => {
                // What was announced wrongly is what the sender should hear of.
                if let Err(error) = bytes.abort().await {
                    tracing::warn!(%error, "an upload could not be removed");
                }
                return Err(error);
            }
        };
        match bytes {
            Sink::Whole(all) => {
                store.written(store.objects().put(&path, all.freeze())).await?;
            }
            Sink::Parts(mut parts) => parts.publish(&store, &path, announced).await?,
        }
        Ok(announced)
    }

    /// Gives up, and returns once nothing is left.
    pub async fn abort(self) -> StoreResult<()> {
        self.bytes.abort().await
    }
}

impl Sink {
    async fn abort(self) -> StoreResult<()> {
        match self {
            Self::Parts(mut parts) => match parts.parts.take() {
                Some(parts) => Ok(parts.abort().await?),
                None => Ok(()),
            },
            Self::Whole(_) => Ok(()),
        }
    }
}

/// Parts that are given up when they are dropped. A folder sees to that itself.
struct Parts {
    parts: Option<WriteMultipart>,
    remote: bool,
}

impl Parts {
    async fn publish(&mut self, store: &ArtifactStore, path: &Path, announced: Announced) -> StoreResult<()> {
        let Some(mut parts) = self.parts.take() else {
            return Ok(());
        };
        // A part that failed is told before the last word is tried.
        if let Err(error) = parts.wait_for_capacity(0).await {
            self.parts = Some(parts);
            return Err(error.into());
        }
        let Err(error) = store.written(parts.finish()).await else {
            return Ok(());
        };
        if !self.remote {
            return Err(error);
        }
        // The last word may have been heard, and its answer lost: then the store knows no such upload when it is said
        // again. Nobody else writes at this path, and it shows nothing before all is there.
        match store.size_of(path).await {
            Ok(size) if size == announced.size => Ok(()),
            _ => Err(error),
        }
    }
}

impl Drop for Parts {
    fn drop(&mut self) {
        let parts = self.parts.take().filter(|_| self.remote);
        let (Some(parts), Ok(runtime)) = (parts, Handle::try_current()) else {
            return;
        };
        runtime.spawn(async move {
            if let Err(error) = parts.abort().await {
                tracing::warn!(%error, "parts of an upload are left in the store");
            }
        });
    }
}
