//! Reads one artifact, piece by piece, from any byte on.
use std::time::Duration;

use object_store::ObjectStoreExt;
use object_store::path::Path;
use prost::bytes::Bytes;
use tokio::time::Instant;

use super::memory::Held;
use super::{ArtifactStore, PIECE_BYTES, StoreError, StoreResult};

/// Bytes that are read ahead for a reader of whom nothing is known yet.
const FIRST_WINDOW: usize = 256 << 10;
/// Whoever takes a window's bytes within this time is given a larger one.
const IN_TIME: Duration = Duration::from_secs(1);
/// Nobody holds one for longer.
const HELD_FOR: Duration = Duration::from_secs(5);

/// An artifact that is being read.
pub struct Reader {
    store: ArtifactStore,
    path: Path,
    /// Of the next byte that is not in the window.
    offset: u64,
    size: u64,
    window: Option<Window>,
    /// Bytes of the next window.
    next: usize,
}

/// Bytes that one request brought, and that were not taken yet.
struct Window {
    bytes: Bytes,
    since: Instant,
    _held: Held,
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
            window: None,
            next: FIRST_WINDOW,
        })
    }

    /// Length of the whole artifact in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The next bytes, at most [`PIECE_BYTES`]; nothing at the end. They are cut from a window that one request brought,
    /// whose size follows from how fast the one before was taken. A window is held for so long only: what was not taken of
    /// it by then is read again.
    pub async fn piece(&mut self) -> StoreResult<Option<Bytes>> {
        if self
            .window
            .as_ref()
            .is_some_and(|window| window.since.elapsed() > HELD_FOR)
        {
            self.rest();
        }
        if self.window.is_none() && self.offset < self.size {
            let held = self.store.memory().hold(self.wanted(self.next)).await;
            let bytes = self.up_to(self.next).await?.unwrap_or_default();
            self.window = Some(Window {
                bytes,
                since: Instant::now(),
                _held: held,
            });
        }
        let Some(window) = &mut self.window else {
            return Ok(None);
        };
        let piece = window.bytes.split_to(window.bytes.len().min(PIECE_BYTES));
        if window.bytes.is_empty() {
            self.next = match window.since.elapsed() < IN_TIME {
                true => (2 * self.next).min(self.store.window()),
                false => self.store.slow_window(),
            };
            self.window = None;
        }
        Ok(Some(piece))
    }

    /// Lets go of what was read ahead, for a reader who takes nothing now. It is read again when it is asked for.
    pub fn rest(&mut self) {
        if let Some(window) = self.window.take() {
            self.offset -= window.bytes.len() as u64;
            self.next = self.store.slow_window();
        }
    }

    /// Bytes that there are of so many.
    fn wanted(&self, most: usize) -> usize {
        usize::try_from(self.size - self.offset).map_or(most, |left| left.min(most))
    }

    /// The next bytes in one request, at most `most`.
    pub(super) async fn up_to(&mut self, most: usize) -> StoreResult<Option<Bytes>> {
        let wanted = self.wanted(most) as u64;
        if wanted == 0 {
            return Ok(None);
        }
        let range = self.offset..self.offset + wanted;
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
}
