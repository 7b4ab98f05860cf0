//! What a server asks of the store before it begins: that it can be used, and that it is this ledger's.
use std::time::Duration;

use object_store::path::Path;
use object_store::{Error, ObjectStoreExt, PutMode, PutPayload};
use tokio::time::{Instant, sleep};
use uuid::Uuid;

use super::{ArtifactStore, StoreError, StoreResult};

/// Where it stands whose artifacts these are.
const OWNER: &str = "ledger";
/// What is written to see whether anything can be.
const PROBES: &str = "probes";
/// How long a service is waited for that may be starting at the same time, and how often it is asked.
const PATIENCE: Duration = Duration::from_secs(30);
const PAUSE: Duration = Duration::from_secs(1);

impl ArtifactStore {
    /// Writes, reads, lists and deletes something small, so that a store that is not there, or does not let this server
    /// do all of that, is found now. One that can't be reached is waited for, half a minute at most.
    pub async fn check(&self) -> StoreResult<()> {
        let end = Instant::now() + PATIENCE;
        loop {
            match self.probe().await {
                Err(error) if error.passes() && Instant::now() + PAUSE < end => {
                    tracing::warn!(place = %self.place(), "the artifact store can't be reached, and is waited for");
                    sleep(PAUSE).await;
                }
                done => return done,
            }
        }
    }

    /// The same, once: for whoever asks how the store is.
    pub async fn probe(&self) -> StoreResult<()> {
        let path = Path::from_iter([PROBES.to_owned(), Uuid::now_v7().to_string()]);
        let put = self.objects().put(&path, PutPayload::from_static(b"probe"));
        self.written(put).await.map_err(|error| match error {
            StoreError::Gone { .. } => self.unusable("written to", StoreError::NoContainer),
            error => self.unusable("written to", error),
        })?;
        let read = self.answered(self.read_small(&path)).await;
        read.map_err(|error| self.unusable("read from", error))?;
        let probes = Path::from(PROBES);
        let listed = self.answered(self.objects().list_with_delimiter(Some(&probes))).await;
        listed.map_err(|error| self.unusable("listed", error))?;
        let deleted = self.answered(self.objects().delete(&path)).await;
        deleted.map_err(|error| self.unusable("deleted from", error))
    }

    /// Takes the store for a ledger, or finds that it is another's, as whose orphans these artifacts would be collected.
    pub async fn claim(&self, ledger: &str) -> StoreResult<()> {
        if self.owner().await?.is_none() {
            self.name_owner(ledger).await?;
        }
        match self.owner().await? {
            Some(owner) if owner == ledger.as_bytes() => Ok(()),
            Some(_) | None => Err(StoreError::OfAnother {
                place: self.place().clone(),
            }),
        }
    }

    async fn owner(&self) -> StoreResult<Option<Vec<u8>>> {
        match self.answered(self.read_small(&Path::from(OWNER))).await {
            Ok(owner) => Ok(Some(owner)),
            Err(StoreError::Gone { .. }) => Ok(None),
            Err(error) => Err(self.unusable("read from", error)),
        }
    }

    async fn name_owner(&self, ledger: &str) -> StoreResult<()> {
        let put = |mode| {
            let payload = PutPayload::from(ledger.to_owned());
            self.written(async move { self.objects().put_opts(&Path::from(OWNER), payload, mode).await })
        };
        let named = match self.is_remote() {
            true => put(PutMode::Create.into()).await,
            // It would take hard links, which not every file system has.
            false => put(PutMode::Overwrite.into()).await,
        };
        let named = match named {
            // Where that can't be asked for, two ledgers that begin at the same moment are not told apart.
            Err(StoreError::Failed(Error::NotImplemented { .. })) => put(PutMode::Overwrite.into()).await,
            named => named,
        };
        match named {
            // Another server may have come first.
            Ok(_) | Err(StoreError::Failed(Error::AlreadyExists { .. })) => Ok(()),
            Err(error) => Err(self.unusable("written to", error)),
        }
    }

    pub(super) async fn read_small(&self, path: &Path) -> object_store::Result<Vec<u8>> {
        Ok(self.objects().get(path).await?.bytes().await?.to_vec())
    }

    fn unusable(&self, what: &'static str, source: StoreError) -> StoreError {
        StoreError::unusable(self.place(), what, source)
    }
}
