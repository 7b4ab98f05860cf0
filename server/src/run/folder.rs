//! The data folder, for one server at a time.
use std::fs::{DirBuilder, File, OpenOptions, TryLockError};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A data folder in use.
#[derive(Debug)]
pub struct DataFolder {
    path: PathBuf,
    /// Locked until it is closed, which also the end of the process does, however it ends.
    _lock: File,
}

impl DataFolder {
    /// Takes the folder, which is made for its owner alone if it is missing.
    pub fn open(path: &Path) -> Result<Self> {
        let failed = |error: std::io::Error| Error::Startup(format!("data_dir {}: {error}", path.display()));
        DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(path)
            .map_err(failed)?;
        let path = path.canonicalize().map_err(failed)?;
        let lock = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(path.join("lock"))
            .map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path, _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(Error::Startup(format!(
                "data_dir {} is in use by another server",
                path.display()
            ))),
            Err(TryLockError::Error(error)) => Err(failed(error)),
        }
    }

    /// The folder, from the root.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn one_at_a_time_and_for_its_owner() {
        let outer = tempfile::TempDir::new().unwrap();
        let path = outer.path().join("a/data");
        let first = DataFolder::open(&path).unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o700);
        let error = DataFolder::open(&path).unwrap_err().to_string();
        assert!(error.ends_with("a/data is in use by another server"), "{error}");
        drop(first);
        DataFolder::open(&path).unwrap();
    }

    #[test]
    fn a_file_in_its_place_is_told() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = DataFolder::open(file.path()).unwrap_err().to_string();
        assert!(error.starts_with("data_dir /"), "{error}");
    }
}
