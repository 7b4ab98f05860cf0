//! A local folder as an object store: with fsync, which is not object_store's default, and without what writers of a
//! server that was killed left in it.
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use object_store::local::LocalFileSystem;
use object_store::path::Path as ObjectPath;

use super::{StoreError, StoreResult};

/// The folder that the store is in.
#[derive(Clone, Debug)]
pub(super) struct Folder(PathBuf);

/// Opens the folder, made if need be.
pub(super) fn open(folder: &Path) -> StoreResult<(Folder, LocalFileSystem)> {
    let failed = |source| StoreError::Folder {
        path: folder.to_owned(),
        source,
    };
    fs::create_dir_all(folder).map_err(failed)?;
    let folder = folder.canonicalize().map_err(failed)?;
    if let Some(parent) = folder.parent() {
        sync(parent)?;
    }
    remove_staged(&folder)?;
    // Folders of attempts are not left behind empty.
    let store = LocalFileSystem::new_with_prefix(&folder)?
        .with_fsync(true)
        .with_automatic_cleanup(true);
    Ok((Folder(folder), store))
}

impl Folder {
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
fn remove_staged(folder: &Path) -> StoreResult<()> {
    let failed = |source| StoreError::Folder {
        path: folder.to_owned(),
        source,
    };
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let path = entry.path();
        if entry.file_type().map_err(failed)?.is_dir() {
            remove_staged(&path)?;
        } else if is_staged(&entry.file_name().to_string_lossy()) {
            tracing::info!(path = %path.display(), "removing an upload that was cut off");
            fs::remove_file(&path).map_err(|source| StoreError::Folder { path, source })?;
        }
    }
    Ok(())
}

fn is_staged(name: &str) -> bool {
    name.split_once('#')
        .is_some_and(|(_, number)| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}
