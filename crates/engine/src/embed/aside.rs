//! Where a marked scene lies until it is known to be good: in the folder of the output, and deleted when dropped.
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::{TempDir, TempPath};

use crate::error::{Error, Result};

/// A scene that has yet to get its name.
#[derive(Debug)]
pub(super) enum Aside {
    /// Of one file, under another name.
    File(TempPath),
    /// Of several, under their own names in a folder, by which they refer to each other.
    Folder { folder: TempDir, path: PathBuf },
}

impl Aside {
    /// A place for a scene that becomes `output`.
    pub fn beside(output: &Path, one_file: bool) -> io::Result<Aside> {
        let mut builder = tempfile::Builder::new();
        let builder = builder.prefix(".guardsplat-").suffix(".part");
        if one_file {
            return Ok(Aside::File(builder.tempfile_in(folder_of(output))?.into_temp_path()));
        }
        let name = output.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
        let folder = builder.tempdir_in(folder_of(output))?;
        let path = folder.path().join(name);
        Ok(Aside::Folder { folder, path })
    }

    /// Where the scene is written to and read from.
    pub fn path(&self) -> &Path {
        match self {
            Aside::File(path) => path,
            Aside::Folder { path, .. } => path,
        }
    }

    /// Frees the space of what was written.
    pub fn clear(&self) -> io::Result<()> {
        match self {
            Aside::File(path) => fs::write(path, []),
            Aside::Folder { folder, .. } => entries(folder.path())?.iter().try_for_each(|entry| {
                if entry.is_dir() {
                    fs::remove_dir_all(entry)
                } else {
                    fs::remove_file(entry)
                }
            }),
        }
    }

    /// Gives it its name; of several files, the one that refers to the others is last.
    pub fn persist(self, output: &Path) -> Result<()> {
        match self {
            Aside::File(path) => path.persist(output).map_err(|e| Error::io(output)(e.error)),
            Aside::Folder { folder, path } => {
                let beside = entries(folder.path()).map_err(Error::io(output))?;
                for file in beside.iter().filter(|file| **file != path) {
                    let to = folder_of(output).join(file.file_name().unwrap_or_default());
                    fs::rename(file, &to).map_err(Error::io(to))?;
                }
                fs::rename(&path, output).map_err(Error::io(output))
            }
        }
    }
}

fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect()
}

fn folder_of(output: &Path) -> &Path {
    match output.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
