//! Where artifacts' bytes are: any number of writers and readers over an object store, by default a local folder.
//!
//! Nothing is visible under its path before all of it arrived and was found to be what was announced: a folder has bytes
//! in a staged file, which is synced and then renamed, a service takes few bytes at once and more in parts, which it
//! keeps apart until they are said to be all. A writer that fails or is dropped leaves nothing. What a client sent to the
//! service itself is copied there first and read then, and removed if it is not right. Which artifacts there are is the
//! ledger's business; the store only knows paths, and those are made of ids.
mod check;
mod error;
mod generation;
mod list;
mod local;
mod memory;
mod multipart;
mod path;
mod place;
mod reader;
mod remote;
mod sealed;
mod sign;
mod spool;
mod start;
mod taken;
mod writer;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use object_store::path::Path as ObjectPath;
use object_store::signer::Signer;
use object_store::{ObjectStore, ObjectStoreExt};
use prost::bytes::Bytes;
use tokio::time::timeout;

pub use check::{Announced, Check};
pub use error::{StoreError, StoreResult};
pub use list::Listed;
pub use memory::TransferMemory;
pub use path::ArtifactPath;
pub use place::Place;
pub use reader::Reader;
pub use remote::is_of_stores;
pub use sealed::MAX_SECRET_BYTES;
pub use sign::UploadUrl;
pub use taken::Taken;
pub use writer::Writer;

/// Most bytes that one chunk has that is sent to the server.
pub const CHUNK_BYTES: usize = 1 << 20;
/// Most bytes that an artifact gives out at once; fewer are not written one by one.
pub const PIECE_BYTES: usize = 32 << 10;

/// Least bytes of a part, but for the last; S3 asks for so many.
const PART_BYTES: u64 = 5 << 20;
/// Most parts of an artifact; S3 and GCS take no more.
const PARTS: u64 = 10_000;
/// Most bytes that one request asks for: answers of a service take long to begin.
const REMOTE_WINDOW: usize = 4 << 20;
const FOLDER_WINDOW: usize = 1 << 20;
/// The same for readers who are slow.
const SLOW_REMOTE_WINDOW: usize = 256 << 10;
const SLOW_FOLDER_WINDOW: usize = 64 << 10;
/// How long a service may take to answer, all repetitions included; to take bytes, longer.
const ANSWER: Duration = Duration::from_secs(15);
const WRITE: Duration = Duration::from_secs(60);
/// And to copy bytes that it has.
const COPY: Duration = Duration::from_secs(5 * 60);

/// The bytes of all artifacts. Cheap to clone.
#[derive(Clone)]
pub struct ArtifactStore {
    inner: Arc<Inner>,
}

struct Inner {
    place: Place,
    objects: Arc<dyn ObjectStore>,
    /// The same, with patience for requests that take the store long.
    patient: Arc<dyn ObjectStore>,
    /// Where it is a folder.
    folder: Option<local::Folder>,
    /// Where it can sign.
    signer: Option<Arc<dyn Signer>>,
    max_bytes: u64,
    /// What bytes under way draw from.
    memory: TransferMemory,
    /// Where parts wait that are not complete.
    spool: PathBuf,
}

impl ArtifactStore {
    /// Opens a folder, which is made if it is missing, and removes what writers of a server that was killed left behind;
    /// so no other server may use it. No artifact may be longer than `max_bytes`.
    pub fn open(folder: &Path, max_bytes: u64) -> StoreResult<Self> {
        Self::in_folder(folder, Duration::ZERO, max_bytes)
    }

    /// Opens a store. Of a folder, which other servers may use too, only what writers left behind is removed that is
    /// older than `abandoned_after`. `environment` says how a service is reached, and as whom; nothing is sent yet.
    pub fn open_at(
        place: &Place,
        environment: impl IntoIterator<Item = (String, String)>,
        abandoned_after: Duration,
        max_bytes: u64,
    ) -> StoreResult<Self> {
        let (service, name, prefix) = match place {
            Place::Folder(folder) => return Self::in_folder(folder, abandoned_after, max_bytes),
            Place::Container { service, name, prefix } => (*service, name, prefix),
        };
        let remote = remote::open(service, name, prefix, environment)
            .map_err(|source| StoreError::unusable(place, "opened", source))?;
        Ok(Self::new(Inner {
            place: place.clone(),
            objects: remote.store,
            patient: remote.patient,
            folder: None,
            signer: Some(remote.signer),
            max_bytes,
            memory: TransferMemory::default(),
            spool: std::env::temp_dir(),
        }))
    }

    fn in_folder(folder: &Path, abandoned_after: Duration, max_bytes: u64) -> StoreResult<Self> {
        let (folder, store) = local::open(folder, abandoned_after)?;
        let store: Arc<dyn ObjectStore> = Arc::new(store);
        Ok(Self::new(Inner {
            place: Place::Folder(folder.path().to_owned()),
            objects: store.clone(),
            patient: store,
            folder: Some(folder),
            signer: None,
            max_bytes,
            memory: TransferMemory::default(),
            spool: std::env::temp_dir(),
        }))
    }

    fn new(inner: Inner) -> Self {
        Self { inner: Arc::new(inner) }
    }

    /// The same, with so much memory for bytes under way, and parts that are not complete in files of this folder, which
    /// have no names. For a store that nobody shares yet.
    pub fn within(mut self, memory: TransferMemory, spool: &Path) -> Self {
        if let Some(inner) = Arc::get_mut(&mut self.inner) {
            inner.memory = memory;
            inner.spool = spool.to_owned();
        }
        self
    }

    /// Where it is.
    pub fn place(&self) -> &Place {
        &self.inner.place
    }

    /// Most bytes that an artifact may have.
    pub fn max_bytes(&self) -> u64 {
        self.inner.max_bytes
    }

    /// Begins to write an artifact. An announced size over the limit is refused here, before any byte is sent.
    pub async fn write(&self, path: &ArtifactPath, announced: Announced) -> StoreResult<Writer> {
        let check = Check::new(announced, self.max_bytes())?;
        Writer::begin(self.clone(), path.as_object_path().clone(), announced, check).await
    }

    /// Begins to read an artifact from byte `offset`, which may be its end.
    pub async fn read(&self, path: &ArtifactPath, offset: u64) -> StoreResult<Reader> {
        Reader::open(self.clone(), path.as_object_path().clone(), offset).await
    }

    /// The first bytes of an artifact, at most `most`, and its length.
    pub async fn head(&self, path: &ArtifactPath, most: usize) -> StoreResult<(Bytes, u64)> {
        let mut reader = self.read(path, 0).await?;
        let head = reader.up_to(most).await?;
        Ok((head.unwrap_or_default(), reader.size()))
    }

    /// Deletes an artifact. One that is not there is none the less deleted.
    pub async fn delete(&self, path: &ArtifactPath) -> StoreResult<()> {
        let path = path.as_object_path();
        match self.answered(self.objects().delete(path)).await {
            Ok(()) => match &self.inner.folder {
                Some(folder) => folder.sync_after_delete(path).await,
                None => Ok(()),
            },
            Err(StoreError::Gone { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// What bytes under way draw from.
    pub(crate) fn memory(&self) -> &TransferMemory {
        &self.inner.memory
    }

    fn spool_folder(&self) -> &Path {
        &self.inner.spool
    }

    fn objects(&self) -> &dyn ObjectStore {
        self.inner.objects.as_ref()
    }

    fn is_remote(&self) -> bool {
        self.inner.folder.is_none()
    }

    async fn size_of(&self, path: &ObjectPath) -> StoreResult<u64> {
        Ok(self.answered(self.objects().head(path)).await?.size)
    }

    /// Bytes of the parts that an artifact of this size goes to a service in; none where it goes at once.
    fn part_bytes(&self, size: u64) -> Option<usize> {
        let part = PART_BYTES.max(size.div_ceil(PARTS).next_multiple_of(1 << 20));
        (size > part).then(|| usize::try_from(part).unwrap_or(usize::MAX))
    }

    /// Most bytes that one request asks for.
    fn window(&self) -> usize {
        match self.is_remote() {
            true => REMOTE_WINDOW,
            false => FOLDER_WINDOW,
        }
    }

    /// The same for readers who are slow.
    fn slow_window(&self) -> usize {
        match self.is_remote() {
            true => SLOW_REMOTE_WINDOW,
            false => SLOW_FOLDER_WINDOW,
        }
    }

    /// What a store says within the time that it has; a disk has all the time it needs.
    async fn answered<T>(&self, call: impl Future<Output = object_store::Result<T>>) -> StoreResult<T> {
        self.in_time(ANSWER, call).await
    }

    /// As [`Self::answered`], for calls that bring bytes.
    async fn written<T>(&self, call: impl Future<Output = object_store::Result<T>>) -> StoreResult<T> {
        self.in_time(WRITE, call).await
    }

    /// As [`Self::answered`], for copies inside the store.
    async fn copied<T>(&self, call: impl Future<Output = object_store::Result<T>>) -> StoreResult<T> {
        self.in_time(COPY, call).await
    }

    async fn in_time<T>(&self, limit: Duration, call: impl Future<Output = object_store::Result<T>>) -> StoreResult<T> {
        if !self.is_remote() {
            return Ok(call.await?);
        }
        timeout(limit, call)
            .await
            .map_err(|_| StoreError::Silent(limit))?
            .map_err(Into::into)
    }
}

/// Without what the store was opened with.
impl fmt::Debug for ArtifactStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ArtifactStore({})", self.inner.place)
    }
}

#[cfg(test)]
pub(crate) mod tests;
