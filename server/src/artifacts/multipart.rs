//! An object that is written in parts, which nobody sees before all are there.
use object_store::path::Path;
use object_store::{MultipartUpload, ObjectStoreExt, PutPayload};
use tokio::runtime::Handle;
use tokio::task::JoinSet;

use super::spool::Spool;
use super::{Announced, ArtifactStore, StoreResult, TransferMemory};

/// Parts that may be on their way to the store while the next one is awaited.
const PARTS_UNDER_WAY: usize = 2;

/// Parts of an object. They are given up when it is dropped before it is published.
pub(super) struct Multipart {
    store: ArtifactStore,
    /// None when there is no more to be done with it.
    upload: Option<Box<dyn MultipartUpload>>,
    under_way: JoinSet<object_store::Result<()>>,
}

impl Multipart {
    pub(super) async fn begin(store: &ArtifactStore, path: &Path) -> StoreResult<Self> {
        Ok(Self {
            upload: Some(store.answered(store.objects().put_multipart(path)).await?),
            store: store.clone(),
            under_way: JoinSet::new(),
        })
    }

    /// Writes a part, and returns when it is written.
    pub(super) async fn put(&mut self, part: PutPayload) -> StoreResult<()> {
        if let Some(upload) = &mut self.upload {
            upload.put_part(part).await?;
        }
        Ok(())
    }

    /// Sends what waits in the spool as a part, and returns when it is on its way: as soon as there is memory for it.
    pub(super) async fn send(&mut self, spool: &mut Spool, memory: &TransferMemory) -> StoreResult<()> {
        self.wait_for(PARTS_UNDER_WAY - 1).await?;
        let (part, held) = spool.take(memory).await?;
        if let Some(upload) = &mut self.upload {
            let sent = upload.put_part(part.into());
            self.under_way.spawn(async move {
                let sent = sent.await;
                drop(held);
                sent
            });
        }
        Ok(())
    }

    /// Waits until at most so many are under way.
    async fn wait_for(&mut self, most: usize) -> StoreResult<()> {
        while self.under_way.len() > most
            && let Some(sent) = self.under_way.join_next().await
        {
            sent.map_err(|source| object_store::Error::JoinError { source })??;
        }
        Ok(())
    }

    /// Says that all parts are there.
    pub(super) async fn publish(&mut self, path: &Path, announced: Announced) -> StoreResult<()> {
        // A part that failed is told before the last word is tried.
        self.wait_for(0).await?;
        let Some(mut upload) = self.upload.take() else {
            return Ok(());
        };
        let Err(error) = self.store.written(upload.complete()).await else {
            return Ok(());
        };
        if !self.store.is_remote() {
            return Err(error);
        }
        // The last word may have been heard, and its answer lost: then the store knows no such upload when it is said
        // again. Nobody else writes at this path, and it shows nothing before all is there.
        if self.store.size_of(path).await.is_ok_and(|size| size == announced.size) {
            return Ok(());
        }
        self.upload = Some(upload);
        Err(error)
    }

    /// Gives them up, and returns once nothing is left.
    pub(super) async fn abort(mut self) -> StoreResult<()> {
        ended(&mut self.under_way).await;
        match self.upload.take() {
            Some(mut upload) => Ok(upload.abort().await?),
            None => Ok(()),
        }
    }
}

impl Drop for Multipart {
    fn drop(&mut self) {
        // A folder sees to that itself.
        let upload = self.upload.take().filter(|_| self.store.is_remote());
        let (Some(mut upload), Ok(runtime)) = (upload, Handle::try_current()) else {
            return;
        };
        let mut under_way = std::mem::take(&mut self.under_way);
        runtime.spawn(async move {
            ended(&mut under_way).await;
            if let Err(error) = upload.abort().await {
                tracing::warn!(%error, "parts of an upload are left in the store");
            }
        });
    }
}

/// Waits for parts whose upload is to be given up. One that is cut off may still be stored after the upload was given up,
/// and then stays: S3 says so of its own.
async fn ended(under_way: &mut JoinSet<object_store::Result<()>>) {
    while under_way.join_next().await.is_some() {}
}
