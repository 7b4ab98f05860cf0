//! Copies of files that are on disk when they are said to be, and hashed on the way.
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::Path;

use sha2::{Digest, Sha256};

const BUFFER: usize = 1 << 20;

/// What was copied.
pub struct Copied {
    pub bytes: u64,
    /// Hexadecimal.
    pub sha256: String,
}

/// Copies a file to where none is yet, for its owner alone.
pub fn copy(from: &Path, to: &Path) -> io::Result<Copied> {
    let mut source = File::open(from)?;
    let mut target = new_file(to)?;
    let copied = pour(&mut source, |bytes| target.write_all(bytes))?;
    target.sync_all()?;
    Ok(copied)
}

/// SHA-256 and length of a file.
pub fn hash(path: &Path) -> io::Result<Copied> {
    pour(&mut File::open(path)?, |_| Ok(()))
}

/// The same of a file that somebody else wrote, whose bytes are on disk when this returns.
pub fn hash_durably(path: &Path) -> io::Result<Copied> {
    let mut file = File::open(path)?;
    file.sync_all()?;
    pour(&mut file, |_| Ok(()))
}

/// Writes a new file, for its owner alone.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = new_file(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

fn new_file(path: &Path) -> io::Result<File> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

fn pour(source: &mut File, mut take: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<Copied> {
    let mut buffer = vec![0; BUFFER];
    let (mut hash, mut bytes) = (Sha256::new(), 0);
    loop {
        let read = source.read(&mut buffer)?;
        if read == 0 {
            break;
        }
        take(&buffer[..read])?;
        hash.update(&buffer[..read]);
        bytes += read as u64;
    }
    Ok(Copied {
        bytes,
        sha256: hex::encode(hash.finalize()),
    })
}

/// Makes a folder, and those above it, for its owner alone.
pub fn make_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// Whether nothing is in a folder but these.
pub fn is_empty_but(path: &Path, names: &[&str]) -> io::Result<bool> {
    for entry in fs::read_dir(path)? {
        if !names
            .iter()
            .any(|name| entry.as_ref().is_ok_and(|e| e.file_name() == *name))
        {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Makes what lies in a folder, and in all below it, durable under its names.
pub fn sync_folders(path: &Path) -> io::Result<()> {
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync_folders(&entry.path())?;
        }
    }
    File::open(path)?.sync_all()
}
