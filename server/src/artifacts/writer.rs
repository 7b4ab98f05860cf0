//! Writes one artifact, chunk by chunk.
use object_store::path::Path;
use object_store::{ObjectStoreExt, PutPayloadMut};
use prost::bytes::Bytes;

use super::multipart::Multipart;
use super::spool::Spool;
use super::{Announced, ArtifactStore, Check, PIECE_BYTES, StoreResult};

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
    /// Into the folder's staged file as they come; a few are gathered.
    Staged(Multipart, PutPayloadMut),
    /// To the service in parts of so many bytes, which it keeps apart until they are said to be all.
    Parts(Multipart, Spool, usize),
    /// To the service at once, as they are few, when all are there.
    Whole(Spool),
}

impl Writer {
    pub(super) async fn begin(
        store: ArtifactStore,
        path: Path,
        announced: Announced,
        check: Check,
    ) -> StoreResult<Self> {
        let spool = || Spool::new(store.spool_folder());
        let bytes = match store.part_bytes(announced.size) {
            _ if !store.is_remote() => Sink::Staged(Multipart::begin(&store, &path).await?, PutPayloadMut::new()),
            Some(part) => Sink::Parts(Multipart::begin(&store, &path).await?, spool(), part),
            None => Sink::Whole(spool()),
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
        let mut chunk = chunk.into();
        self.check.chunk(&chunk)?;
        match &mut self.bytes {
            Sink::Staged(file, few) => {
                few.push(chunk);
                if few.content_length() >= PIECE_BYTES {
                    file.put(std::mem::take(few).freeze()).await?;
                }
            }
            Sink::Parts(parts, spool, size) => {
                while !chunk.is_empty() {
                    let room = *size - spool.length();
                    spool.push(chunk.split_to(chunk.len().min(room))).await?;
                    if spool.length() == *size {
                        parts.send(spool, self.store.memory()).await?;
                    }
                }
            }
            Sink::Whole(spool) => spool.push(chunk).await?,
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
            Sink::Staged(mut file, few) => {
                if !few.is_empty() {
                    file.put(few.freeze()).await?;
                }
                file.publish(&path, announced).await?;
            }
            Sink::Parts(mut parts, mut spool, _) => {
                if spool.length() > 0 {
                    parts.send(&mut spool, store.memory()).await?;
                }
                parts.publish(&path, announced).await?;
            }
            Sink::Whole(mut spool) => {
                let (all, _held) = spool.take(store.memory()).await?;
                store.written(store.objects().put(&path, all.into())).await?;
            }
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
            Self::Staged(parts, _) | Self::Parts(parts, ..) => parts.abort().await,
            Self::Whole(_) => Ok(()),
        }
    }
}
