//! Which store the settings name: a folder in the data folder, or one that several servers may share.
use std::path::Path;

use crate::artifacts::{ArtifactStore, StoreResult, TransferMemory};
use crate::error::{Error, Result};
use crate::ledger::Ledger;
use crate::notary::Notary;
use crate::service::store_generation::{self, CONTESTED, Standing};
use crate::settings::Settings;

use super::startup;

/// Opens the store and sees that it can be used. `folder` is the data folder.
pub(crate) async fn open(settings: &Settings, folder: &Path) -> Result<ArtifactStore> {
    let store = named(settings, folder)?;
    tracing::info!(artifacts = %store.place(), "artifacts are there");
    store.check().await.map_err(startup)?;
    Ok(store)
}

fn named(settings: &Settings, folder: &Path) -> Result<ArtifactStore> {
    let most = settings.max_artifact_bytes;
    let opened: StoreResult<_> = match settings.place().map_err(startup)? {
        None => ArtifactStore::open(&folder.join("artifacts"), most),
        Some(place) => ArtifactStore::open_at(
            &place,
            std::env::vars_os().filter_map(text),
            settings.abandoned_after(),
            most,
        ),
    };
    let memory = TransferMemory::new(settings.transfer_memory());
    Ok(opened.map_err(startup)?.within(memory, folder))
}

/// Sees that the store is this ledger's, which is known by the key that only it has, and that the ledger is no copy of
/// one that goes on.
pub(crate) async fn claim(store: &ArtifactStore, notary: &Notary, ledger: &dyn Ledger, now: i64) -> Result<()> {
    own(store, notary).await?;
    match store_generation::standing(ledger, store, now).await.map_err(startup)? {
        Standing::Ours => Ok(()),
        Standing::Contested => {
            tracing::error!(place = %store.place(), "{CONTESTED}");
            Ok(())
        }
        Standing::Behind => Err(Error::Startup(format!(
            "artifacts: {} went on with another copy of this ledger, and would lose what came to it since; name another \
             place, or say `guardsplat-server store take-over` if the other one is gone for good",
            store.place()
        ))),
    }
}

/// Takes the store for this ledger, whatever copy of it it went on with.
pub(crate) async fn take_over(store: &ArtifactStore, notary: &Notary, ledger: &dyn Ledger, now: i64) -> Result<()> {
    own(store, notary).await?;
    store_generation::take_over(ledger, store, now).await.map_err(startup)
}

async fn own(store: &ArtifactStore, notary: &Notary) -> Result<()> {
    store
        .claim(&hex::encode(notary.public_key().to_bytes()))
        .await
        .map_err(startup)
}

/// A variable that is not text is none of a store's.
fn text((name, value): (std::ffi::OsString, std::ffi::OsString)) -> Option<(String, String)> {
    Some((name.into_string().ok()?, value.into_string().ok()?))
}
