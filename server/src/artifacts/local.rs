//! A local folder as an object store: with fsync, which is not object_store's default, and without what writers of a
//! server that was killed left in it.
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use object_store::local::LocalFileSystem;
use object_store::path::Path as ObjectPath;

use super::{StoreError, StoreResult};

/// What object_store calls a folder in its errors; whatever else it names is reached by a network.
pub(super) const FOLDER: &str = "LocalFileSystem";

/// The folder that the store is in.
#[derive(Clone, Debug)]
pub(super) struct Folder(PathBuf);

/// Opens the folder, made if need be. Staged files that nobody wrote to for `abandoned_after` are removed.
pub(super) fn open(folder: &Path, abandoned_after: Duration) -> StoreResult<(Folder, LocalFileSystem)> {
    let failed = |source| StoreError::Folder {
        path: folder.to_owned(),
        source,
    };
    fs::create_dir_all(folder).map_err(failed)?;
    let folder = folder.canonicalize().map_err(failed)?;
    if let Some(parent) = folder.parent() {
        sync(parent)?;
    }
    remove_staged(&folder, abandoned_after)?;
    // Folders of attempts are not left behind empty.
    let store = LocalFileSystem::new_with_prefix(&folder)?
        .with_fsync(true)
        .with_automatic_cleanup(true);
    Ok((Folder(folder), store))
}

impl Folder {
    /// Its path from the root on.
    pub(super) fn path(&self) -> &Path {
        &self.0
    }

    /// Makes a deletion durable, which object_store leaves to chance: a file that comes back after a power cut would
    /// belong to nobody.
    pub(super) async fn sync_after_delete(&self, path: &ObjectPath) -> StoreResult<()> {
        let root = self.0.clone();
        let file = root.join(path.as_ref());
        let synced = tokio::task::spawn_blocking(move || {
            // The file's own folder may have been removed with it.
            let kept = file.ancestors().skip(1).find(|folder| folder.exists()).unwrap_or(&root);
            sync(kept)
        });
        synced.await.map_err(|error| StoreError::Folder {
            path: self.0.clone(),
            source: io::Error::other(error),
        })?
    }
}

fn sync(folder: &Path) -> StoreResult<()> {
    File::open(folder)
        .and_then(|file| file.sync_all())
        .map_err(|source| StoreError::Folder {
            path: folder.to_owned(),
            source,
        })
}

/// Removes files that were being written when a server was killed; object_store stages them as `NAME#NUMBER`, which is
/// no path of an artifact.
fn remove_staged(folder: &Path, abandoned_after: Duration) -> StoreResult<()> {
    let failed = |source| StoreError::Folder {
        path: folder.to_owned(),
        source,
    };
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let path = entry.path();
        if entry.file_type().map_err(failed)?.is_dir() {
            remove_staged(&path, abandoned_after)?;
        } else if is_staged(&entry.file_name().to_string_lossy()) && is_older(&entry, abandoned_after) {
            tracing::info!(path = %path.display(), "removing an upload that was cut off");
            fs::remove_file(&path).map_err(|source| StoreError::Folder { path, source })?;
        }
    }
    Ok(())
}

/// Whether a file was last written to so long ago. Of one that is gone meanwhile nothing is left to do.
fn is_older(entry: &fs::DirEntry, age: Duration) -> bool {
    let written = entry.metadata().and_then(|metadata| metadata.modified());
    written.is_ok_and(|written| age.is_zero() || SystemTime::now().duration_since(written).is_ok_and(|past| past > age))
}

fn is_staged(name: &str) -> bool {
    name.split_once('#')
        .is_some_and(|(_, number)| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}
