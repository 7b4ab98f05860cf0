//! Bytes of an upload that are not a part yet: the first few in memory, all of them in a file without a name when there
//! are more. So an upload that stops half-way takes room on the disk.
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use prost::bytes::Bytes;
use tempfile::SpooledTempFile;
use tokio::task::spawn_blocking;

use super::local::FOLDER;
use super::memory::Held;
use super::{PIECE_BYTES, StoreResult, TransferMemory};

/// Bytes that wait.
pub(super) struct Spool {
    /// Away while something is done with it.
    file: Option<SpooledTempFile>,
    folder: PathBuf,
    length: usize,
}

impl Spool {
    /// One whose file, if it needs one, is in this folder.
    pub(super) fn new(folder: &Path) -> Self {
        Self {
            file: None,
            folder: folder.to_owned(),
            length: 0,
        }
    }

    /// Bytes that wait.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Puts more behind what waits.
    pub(super) async fn push(&mut self, bytes: Bytes) -> StoreResult<()> {
        let length = bytes.len();
        self.with(move |file| file.write_all(&bytes)).await?;
        self.length += length;
        Ok(())
    }

    /// All that waits, as soon as there is memory for it; nothing waits then.
    pub(super) async fn take(&mut self, memory: &TransferMemory) -> StoreResult<(Bytes, Held)> {
        let length = self.length;
        let held = memory.hold(length).await;
        let bytes = self
            .with(move |file| {
                let mut bytes = vec![0; length];
                file.rewind()?;
                file.read_exact(&mut bytes)?;
                file.rewind()?;
                file.set_len(0)?;
                Ok(bytes)
            })
            .await?;
        self.length = 0;
        Ok((bytes.into(), held))
    }

    async fn with<T: Send + 'static>(
        &mut self,
        work: impl FnOnce(&mut SpooledTempFile) -> std::io::Result<T> + Send + 'static,
    ) -> StoreResult<T> {
        let file = self.file.take();
        let mut file = file.unwrap_or_else(|| SpooledTempFile::new_in(PIECE_BYTES, &self.folder));
        let done = spawn_blocking(move || work(&mut file).map(|done| (file, done))).await;
        let (file, done) = done.map_err(std::io::Error::other).flatten().map_err(failed)?;
        self.file = Some(file);
        Ok(done)
    }
}

/// As the store itself tells of a folder's errors, a full disk among them.
fn failed(error: std::io::Error) -> object_store::Error {
    object_store::Error::Generic {
        store: FOLDER,
        source: Box::new(error),
    }
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    #[tokio::test]
    async fn what_waits_is_on_the_disk_and_comes_back_in_order() {
        let (folder, memory) = (TempDir::new().unwrap(), TransferMemory::default());
        let all = memory.free();
        let mut spool = Spool::new(folder.path());
        for round in 0..3_u8 {
            for piece in 0..5_u8 {
                spool.push(vec![round + piece; PIECE_BYTES].into()).await.unwrap();
            }
            assert_eq!((spool.length(), memory.free()), (5 * PIECE_BYTES, all));
            assert!(spool.file.as_ref().unwrap().is_rolled());
            // It has no name that anybody would have to remove.
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
            let (bytes, held) = spool.take(&memory).await.unwrap();
            let pieces: Vec<_> = bytes.chunks(PIECE_BYTES).map(|piece| piece[0]).collect();
            assert_eq!((bytes.len(), spool.length()), (5 * PIECE_BYTES, 0));
            assert_eq!(pieces, [round, round + 1, round + 2, round + 3, round + 4]);
            assert!(memory.free() < all);
            drop(held);
        }
        assert_eq!(memory.free(), all);
    }
}
