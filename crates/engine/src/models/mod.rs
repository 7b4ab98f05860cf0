//! Model weights that an operator added: CLIP models to use instead of the shipped one, and LPIPS.
//!
//! Each lies in a folder of its own under `models/` in the data folder, with a manifest of file hashes.
mod add;
mod fetch;
pub mod lpips;

use crate::clip::hash;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
/// Most bytes of a manifest that are read.
const MAX_MANIFEST: u64 = 1 << 16;
/// The weights file in a model's folder.
pub const WEIGHTS: &str = "model.safetensors";
const CONFIG: &str = "config.json";
const PREPROCESSOR: &str = "preprocessor_config.json";
/// The name under which LPIPS finds its weights; every other name is a CLIP.
pub const LPIPS: &str = "lpips-alex";

/// The models of a data folder.
#[derive(Clone, Debug)]
pub struct Models {
    folder: PathBuf,
}

/// A model that was added.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// What it is called.
    pub name: String,
    /// The path or URL it came from.
    pub source: String,
    /// Its files.
    pub files: BTreeMap<String, FileEntry>,
}

/// A file of a model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// SHA-256 in hexadecimal.
    pub sha256: String,
    /// Size.
    pub bytes: u64,
}

impl Models {
    /// The models in the data folder: `$GUARDSPLAT_HOME`, else `guardsplat` in `$XDG_DATA_HOME` or `~/.local/share`.
    ///
    /// # Errors
    /// [`Error::BadOption`] when none of the variables nor `HOME` is set.
    pub fn open() -> Result<Self> {
        let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let data = variable("GUARDSPLAT_HOME")
            .or_else(|| variable("XDG_DATA_HOME").map(|d| d.join("guardsplat")))
            .or_else(|| variable("HOME").map(|d| d.join(".local/share/guardsplat")));
        data.map(Self::at).ok_or_else(|| Error::BadOption {
            field: "GUARDSPLAT_HOME",
            reason: "no data folder: set this variable to where models are kept".into(),
        })
    }

    /// The models in this data folder.
    pub fn at(data: impl AsRef<Path>) -> Self {
        Self {
            folder: data.as_ref().join("models"),
        }
    }

    /// The folder of a model that was added, for [`crate::clip::Clip::load`].
    ///
    /// # Errors
    /// [`Error::BadModel`] when there is none of that name.
    pub fn dir(&self, name: &str) -> Result<PathBuf> {
        check_name(name)?;
        let dir = self.folder.join(name);
        match dir.join(MANIFEST).is_file() {
            true => Ok(dir),
            false => Err(bad(
                name,
                format!("is not in {}; add it with `models add`", self.folder.display()),
            )),
        }
    }

    /// All models, by name.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::BadModel`] when a folder or manifest cannot be read.
    pub fn list(&self) -> Result<Vec<Entry>> {
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(Error::io(&self.folder)(error)),
        };
        let mut found = Vec::new();
        for entry in entries {
            let name = entry.map_err(Error::io(&self.folder))?.file_name();
            // What is not a model's name is an unfinished `add`, or not ours.
            if let Some(name) = name.to_str().filter(|n| self.dir(n).is_ok()) {
                found.push(self.entry(name)?);
            }
        }
        found.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(found)
    }

    /// Hashes every file of a model again and compares with the manifest.
    ///
    /// # Errors
    /// [`Error::BadModel`] naming the file and both hashes when one differs, [`Error::Io`] when one is missing.
    pub fn verify(&self, name: &str) -> Result<Entry> {
        let (dir, entry) = (self.dir(name)?, self.entry(name)?);
        for (file, expected) in &entry.files {
            let path = dir.join(file);
            let mut reader = std::fs::File::open(&path).map_err(Error::io(&path))?;
            let found = hash(&mut reader).map_err(Error::io(&path))?;
            if found != expected.sha256 {
                return Err(bad(
                    name,
                    format!("{file} has hash {found}, expected {}", expected.sha256),
                ));
            }
        }
        Ok(entry)
    }

    fn entry(&self, name: &str) -> Result<Entry> {
        let path = self.dir(name)?.join(MANIFEST);
        let file = std::fs::File::open(&path).map_err(Error::io(&path))?;
        let mut text = Vec::new();
        let mut bounded = std::io::Read::take(file, MAX_MANIFEST);
        std::io::Read::read_to_end(&mut bounded, &mut text).map_err(Error::io(&path))?;
        Entry::parse(&text).map_err(|reason| bad(name, format!("{MANIFEST} {reason}")))
    }
}

impl Entry {
    /// Reads a manifest; `Err` says what is wrong with it.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let entry: Entry = serde_json::from_slice(text).map_err(|e| format!("cannot be read: {e}"))?;
        let known = [WEIGHTS, CONFIG, PREPROCESSOR];
        match entry.files.keys().find(|file| !known.contains(&file.as_str())) {
            Some(file) => Err(format!("names an unknown file, {file:?}")),
            None => Ok(entry),
        }
    }
}

/// Names become folders: lower case letters, digits, and `-._` after the first character.
fn check_name(name: &str) -> Result<()> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    let fine = (1..=64).contains(&name.len())
        && name.starts_with(plain)
        && name.chars().all(|c| plain(c) || "-._".contains(c));
    match fine {
        true => Ok(()),
        false => Err(bad(
            name,
            "a name has 1 to 64 lower case letters, digits, '-', '.' and '_', none of these first",
        )),
    }
}

fn bad(name: &str, reason: impl ToString) -> Error {
    Error::BadModel {
        name: name.to_owned(),
        reason: reason.to_string(),
    }
}

#[cfg(test)]
mod tests;
