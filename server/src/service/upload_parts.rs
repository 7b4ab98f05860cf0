//! Uploads that arrive in parts, by `AppendUpload`: for callers whose connection may break off, and who can't send a stream.
//!
//! What has arrived is with the writer of the artifact to be, in the memory of this server; what it is to be is sealed in
//! the upload's name. A part is written to its end once it has arrived whole, whatever becomes of the call that brought it,
//! so the count of bytes is always that of the writer. The row comes when all bytes were found right, as for those that a
//! client sends to the store.
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use guardsplat_proto::v1::{StartUploadResponse, UploadMetadata};
use tokio::time::Instant;
use uuid::Uuid;

use super::direct_upload::PendingUpload;
use crate::artifacts::{ArtifactPath, CHUNK_BYTES, Writer};
use crate::error::{Error, Result};
use crate::ledger::{ArtifactRow, UploadReservation};
use crate::service::concurrency_limit::Permit;
use crate::service::{Service, clock, upload};

/// What has arrived is kept so long without another part.
const PAUSE: Duration = Duration::from_secs(15 * 60);

/// Uploads of which something has arrived. Those that a caller may have at once are its transfers.
#[derive(Default)]
pub(crate) struct ArrivingUploads(Mutex<HashMap<Uuid, Entry>>);

#[derive(Clone)]
struct Entry {
    upload: Slot,
    touched: Instant,
}

/// One upload; calls for it take turns. Empty when nothing has arrived, or no more is to come.
type Slot = Arc<tokio::sync::Mutex<Option<Arriving>>>;

/// What has arrived of one.
struct Arriving {
    writer: Writer,
    path: ArtifactPath,
    received: u64,
    _permit: Option<Permit>,
}

impl ArrivingUploads {
    fn slot(&self, id: Uuid) -> Slot {
        let mut open = self.lock();
        let entry = open.entry(id).or_insert_with(|| Entry {
            upload: Slot::default(),
            touched: Instant::now(),
        });
        entry.touched = Instant::now();
        entry.upload.clone()
    }

    /// Forgets one of which nothing is there.
    fn forget(&self, id: Uuid) {
        self.lock().remove(&id);
    }

    /// Lets go of what has been without a part for `pause`. Dropped, it leaves nothing in the store.
    pub fn end_paused(&self, pause: Duration) {
        let ended: Vec<Entry> = {
            let mut open = self.lock();
            let paused = open.extract_if(|_, entry| entry.touched.elapsed() >= pause);
            paused.map(|(_, entry)| entry).collect()
        };
        drop(ended);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Uuid, Entry>> {
        // What it holds is whole at every moment.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Service {
    /// Lets go of uploads that nothing was added to for too long.
    pub(crate) fn end_paused_uploads(&self) {
        self.arriving().end_paused(PAUSE);
    }

    /// A name for an upload in parts, and its bytes reserved.
    pub(super) async fn start_in_parts(&self, project: &str, metadata: UploadMetadata) -> Result<StartUploadResponse> {
        let (id, now) = (Uuid::now_v7(), clock::now());
        self.reserve_bytes(UploadReservation {
            id,
            project: project.to_owned(),
            size: metadata.size_bytes,
            // There is no address, so nothing is waited for when it is refused.
            address_end: now,
            end_time: self.end_of_reservation(now),
        })
        .await?;
        Ok(StartUploadResponse {
            upload: self.name_of_upload(project, id, now, metadata, true)?,
            ..StartUploadResponse::default()
        })
    }

    /// Takes the next part, if it belongs where the last one ended, and says how many bytes have arrived. `permit` is
    /// asked for once an upload.
    pub(crate) async fn append(
        &self,
        project: &str,
        name: &str,
        offset: u64,
        chunk: Vec<u8>,
        permit: impl FnOnce() -> Result<Option<Permit>>,
    ) -> Result<u64> {
        let (id, begun) = self.begun_upload(project, name)?;
        if !begun.in_parts {
            return Err(Error::invalid(
                "upload",
                "was not begun with in_parts, and goes to its address",
            ));
        }
        if chunk.len() > CHUNK_BYTES {
            return Err(Error::invalid(
                "chunk",
                format!("has {} bytes, more than {CHUNK_BYTES}", chunk.len()),
            ));
        }
        self.in_time(&begun)?;
        self.end_paused_uploads();
        let mut arriving = self.arriving().slot(id).lock_owned().await;
        if arriving.is_none() {
            if self.finished(id).await?.is_some() {
                self.arriving().forget(id);
                return Ok(begun.size());
            }
            if offset > 0 || chunk.is_empty() {
                self.arriving().forget(id);
                return Ok(0);
            }
            *arriving = Some(self.begin(project, id, &begun, permit).await?);
        }
        let Some(mut there) = arriving.take_if(|there| there.received == offset && !chunk.is_empty()) else {
            return Ok(arriving.as_ref().map_or(0, |there| there.received));
        };
        // To its end, even if the caller is gone.
        let written = tokio::spawn(async move {
            let length = chunk.len() as u64; // at most a mebibyte
            there.writer.chunk(chunk).await?;
            there.received += length;
            let received = there.received;
            *arriving = Some(there);
            Ok(received)
        });
        let written = written.await.map_err(|error| Error::internal("taking a part", error))?;
        if written.is_err() {
            self.arriving().forget(id);
        }
        written
    }

    async fn begin(
        &self,
        project: &str,
        id: Uuid,
        begun: &PendingUpload,
        permit: impl FnOnce() -> Result<Option<Permit>>,
    ) -> Result<Arriving> {
        let announced = upload::announced("upload", &begun.metadata)?;
        let permit = permit()?;
        if !self.ledger().is_reserved(id).await? {
            self.room_for_bytes(project, announced.size).await?;
        }
        let path = ArtifactPath::taken(Uuid::now_v7(), id);
        Ok(Arriving {
            writer: self.store().write(&path, announced).await?,
            path,
            received: 0,
            _permit: permit,
        })
    }

    /// The artifact that has arrived in parts, and whether it is new.
    pub(super) async fn finish_in_parts(
        &self,
        project: &str,
        id: Uuid,
        begun: PendingUpload,
    ) -> Result<(ArtifactRow, bool)> {
        let mut arriving = self.arriving().slot(id).lock_owned().await;
        if let Some(row) = self.finished(id).await? {
            self.arriving().forget(id);
            return Ok((row, false));
        }
        self.in_time(&begun)?;
        let size = begun.size();
        let Some(there) = arriving.take_if(|there| there.received == size) else {
            let received = arriving.as_ref().map_or(0, |there| there.received);
            let text = format!("{received} of {size} bytes have arrived; AppendUpload takes the others");
            return Err(Error::invalid("upload", text));
        };
        let (service, project) = (self.clone(), project.to_owned());
        // To its end, even if the caller is gone, and with others waiting for it.
        let finished = tokio::spawn(async move {
            let finished = service.finish_arrived(&project, id, begun.metadata, there).await;
            service.arriving().forget(id);
            drop(arriving);
            finished
        });
        finished
            .await
            .map_err(|error| Error::internal("finishing an upload", error))?
    }

    async fn finish_arrived(
        &self,
        project: &str,
        id: Uuid,
        metadata: UploadMetadata,
        there: Arriving,
    ) -> Result<(ArtifactRow, bool)> {
        let Arriving { writer, path, .. } = there;
        if let Err(error) = writer.finish().await {
            let error = Error::from(error);
            if matches!(error, Error::Invalid(_)) {
                self.ledger().end_with_address(id).await?;
            }
            return Err(error);
        }
        Ok((self.publish(project, id, metadata, path).await?, true))
    }
}
