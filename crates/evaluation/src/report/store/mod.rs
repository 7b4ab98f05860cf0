//! A folder of results that survives crashes: every record is on disk before the next is made.
mod records;

pub use records::{Note, Records};

use super::record::{Id, Record};
use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of the file of records in a store's folder; one JSON object a line.
pub const FILE: &str = "results.jsonl";
/// How often, and after what time, it is tried to have the file for oneself.
const TRIES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(25);

/// A folder of results that is open for writing, by nobody else.
#[derive(Debug)]
pub struct Store {
    file: File,
    path: PathBuf,
    folder: PathBuf,
    /// Bytes of whole lines.
    length: u64,
    /// A failed append could not be undone: more would follow half a line.
    torn: bool,
    records: Records,
}

/// What a line holds, borrowed.
#[derive(Serialize)]
struct Line<'a> {
    id: &'a Id,
    record: &'a Record,
}

impl Store {
    /// Opens the store in a folder; makes both where they are not there.
    ///
    /// A last line that a crash tore is dropped from the file and noted, see [`Records::notes`].
    ///
    /// # Errors
    /// [`Error::Locked`] while it is open elsewhere, here or in another process; [`Error::BadResults`] with the line
    /// if the file holds anything else than records; [`Error::Io`].
    pub fn open(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        let path = folder.join(FILE);
        let mut options = OpenOptions::new();
        let file = options.read(true).append(true).create(true).open(&path);
        let mut file = file.map_err(Error::io(&path))?;
        // A program that is being started holds what is open here until it runs: that is no other evaluation.
        let mut tries = 0;
        loop {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if tries < TRIES => {
                    tries += 1;
                    std::thread::sleep(PAUSE);
                }
                Err(TryLockError::WouldBlock) => return Err(Error::Locked { path }),
                Err(TryLockError::Error(source)) => return Err(Error::Io { path, source }),
            }
        }
        let (records, mut length) = Records::parse(&mut file, &path)?;
        let mut repair = || -> std::io::Result<()> {
            file.set_len(length.whole)?;
            if length.newline_is_missing {
                file.write_all(b"\n")?;
                length.whole += 1;
            }
            file.sync_all()
        };
        repair().map_err(Error::io(&path))?;
        // The file's name is durable once its folder is; not every file system can do that.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
        Ok(Self {
            file,
            path,
            folder: folder.to_path_buf(),
            length: length.whole,
            torn: false,
            records,
        })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What it holds.
    pub fn records(&self) -> &Records {
        &self.records
    }

    /// Whether there is a record of this identity.
    pub fn has(&self, id: &Id) -> bool {
        self.records.has(id)
    }

    /// Adds a record; it is on disk when this returns.
    ///
    /// # Errors
    /// [`Error::BadOption`] if its numbers are impossible, there is one of this identity, or its mark is not here;
    /// [`Error::Io`], with the file as it was before.
    pub fn append(&mut self, record: Record) -> Result<Id> {
        let id = record.id();
        self.records.check(&id, &record)?;
        if self.torn {
            return Err(Error::BadResults {
                path: self.path.clone(),
                reason: "an earlier line was written in part; open the store again".into(),
            });
        }
        let mut line = serde_json::to_vec(&Line {
            id: &id,
            record: &record,
        })
        .map_err(|e| Error::Codec {
            codec: "JSON",
            reason: e.to_string(),
        })?;
        line.push(b'\n');
        let file = &mut self.file;
        let written = file
            .write_all(&line)
            .and_then(|()| file.flush())
            .and_then(|()| file.sync_data());
        if let Err(source) = written {
            self.torn = file.set_len(self.length).is_err();
            let path = self.path.clone();
            return Err(Error::Io { path, source });
        }
        self.length += line.len() as u64;
        self.records.insert(id.clone(), record);
        Ok(id)
    }
}

#[cfg(test)]
mod tests;
