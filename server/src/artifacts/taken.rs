//! Takes bytes that went to the store without the server: by a copy inside the store, to where no address for writing
//! was ever given out. What was checked is the copy, so it does not matter what becomes of the first.
use object_store::ObjectStoreExt;
use tokio::runtime::Handle;

use super::{Announced, ArtifactPath, ArtifactStore, Check, StoreError, StoreResult};

/// A copy that was found to be what was announced. It is removed again unless it is kept.
pub struct Taken {
    store: ArtifactStore,
    path: Option<ArtifactPath>,
}

impl ArtifactStore {
    /// Copies what lies at `staged` to `path`, where nobody else writes, and reads all of the copy. What has another
    /// length than was announced is not read.
    pub async fn take(&self, staged: &ArtifactPath, path: ArtifactPath, announced: Announced) -> StoreResult<Taken> {
        let check = Check::new(announced, self.max_bytes())?;
        of_length(announced, self.size_of(staged.as_object_path()).await?)?;
        // Before there is a copy: a caller who goes away amid it leaves one all the same.
        let taken = Taken {
            store: self.clone(),
            path: Some(path.clone()),
        };
        match self.copy_and_read(staged, &path, check, announced).await {
            Ok(()) => Ok(taken),
            Err(error) => {
                if let Err(error) = taken.remove().await {
                    tracing::warn!(%error, %path, "a copy that is not kept could not be removed");
                }
                Err(error)
            }
        }
    }

    async fn copy_and_read(
        &self,
        staged: &ArtifactPath,
        path: &ArtifactPath,
        mut check: Check,
        announced: Announced,
    ) -> StoreResult<()> {
        let copy = self.inner.patient.copy(staged.as_object_path(), path.as_object_path());
        self.copied(copy).await?;
        let mut copy = self.read(path, 0).await?;
        // Something else may have been sent after the first look.
        of_length(announced, copy.size())?;
        while let Some(piece) = copy.piece().await? {
            check.chunk(&piece)?;
        }
        check.finish()?;
        Ok(())
    }
}

fn of_length(announced: Announced, found: u64) -> StoreResult<()> {
    if announced.size == found {
        return Ok(());
    }
    Err(StoreError::OtherLength {
        announced: announced.size,
        found,
    })
}

impl Taken {
    /// Has it stay.
    pub fn keep(mut self) {
        self.path = None;
    }

    /// Gives it up, and returns once nothing is left.
    pub async fn remove(mut self) -> StoreResult<()> {
        if let Some(path) = &self.path {
            self.store.delete(path).await?;
        }
        self.path = None;
        Ok(())
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        let (Some(path), Ok(runtime)) = (self.path.take(), Handle::try_current()) else {
            return;
        };
        let store = self.store.clone();
        runtime.spawn(async move {
            if let Err(error) = store.delete(&path).await {
                tracing::warn!(%error, %path, "a copy that is not kept is left in the store");
            }
        });
    }
}
