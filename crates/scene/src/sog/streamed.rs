//! A SOG that is streamed in levels of detail: a folder with `lod-meta.json`, and a SOG for every part of every level.
use super::index::{self, Unit};
use super::level;
use crate::error::bad;
use crate::{BadRows, Error, Result, Scene};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

/// What is where.
pub(crate) const INDEX: &str = "lod-meta.json";
/// The word by which an index is known, however it is called.
const KNOWN_BY: &[u8] = b"\"lodLevels\"";
/// Largest index: 200 bytes a tile and level.
const MAX_INDEX: u64 = 256 << 20;
/// How deep folders may be in each other.
const MAX_DEPTH: usize = 16;

/// A streamed SOG on this machine, of which only the index was read.
#[derive(Clone, Debug)]
pub struct StreamedSog {
    folder: PathBuf,
    levels: Vec<Vec<Unit>>,
}

impl StreamedSog {
    /// Opens a folder with a `lod-meta.json`, or that file; `None` for everything else.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::BadScene`] for an index that is damaged, or leads out of its folder.
    pub fn open(path: &Path) -> Result<Option<StreamedSog>> {
        let index = match path.is_dir() {
            true => path.join(INDEX),
            false => path.into(),
        };
        if !index.is_file() {
            return Ok(None);
        }
        let failed = Error::io(&index);
        let mut text = Vec::new();
        let mut file = fs::File::open(&index).map_err(Error::io(&index))?;
        // Of a file by another name the beginning is looked at first: it may be a scene of many gigabytes.
        let head = (&mut file).take(crate::HEAD as u64).read_to_end(&mut text);
        head.map_err(Error::io(&index))?;
        if !announced(&text) {
            return match path.is_dir() {
                true => Err(bad(&index, "no lodLevels at its beginning".to_string())),
                false => Ok(None),
            };
        }
        file.take(MAX_INDEX).read_to_end(&mut text).map_err(failed)?;
        if text.len() as u64 >= MAX_INDEX {
            return Err(bad(&index, format!("more than {MAX_INDEX} bytes, the limit")));
        }
        let levels = index::parse(&text).map_err(|reason| bad(&index, reason))?;
        let folder = index.parent().unwrap_or(Path::new("")).into();
        Ok(Some(StreamedSog { folder, levels }))
    }

    /// How many levels there are. 0 is the finest.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// Gaussians of a level, in all tiles; none where there is no such level.
    pub fn gaussians(&self, level: usize) -> u64 {
        self.units(level).iter().map(|unit| unit.gaussians).sum()
    }

    fn units(&self, level: usize) -> &[Unit] {
        self.levels.get(level).map_or(&[], Vec::as_slice)
    }

    /// Reads a level of all tiles as one scene, within `memory` bytes. It is written as a streamed SOG of that level alone.
    ///
    /// # Errors
    /// Those of [`Scene::read_with_files`]; [`Error::BadScene`] for a level that is not there, or has no Gaussian.
    pub fn read(&self, level: usize, bad_rows: BadRows, memory: u64) -> Result<Scene> {
        let (count, path) = (self.levels(), self.folder.join(INDEX));
        if level >= count {
            return Err(bad(&path, format!("no level {level}: there are {count}, from 0")));
        }
        if self.gaussians(level) == 0 {
            return Err(bad(&path, format!("no tile has Gaussians of level {level}")));
        }
        let read = level::read(&self.folder, self.units(level), bad_rows, memory)?;
        Scene::of(&path, read)
    }

    /// Copies all files to a folder that is there and empty, but for those of levels. Those of the environment, which is no
    /// level, are among them.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn copy_rest(&self, to: &Path) -> Result<()> {
        let units: Vec<PathBuf> = self.levels.iter().flatten().map(Unit::path).collect();
        copy(&self.folder, to, Path::new(""), &units, MAX_DEPTH)
    }

    /// Moves the files of a level from a folder that it was written to, into one of [`copy_rest`](Self::copy_rest).
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn move_level(&self, level: usize, from: &Path, to: &Path) -> Result<()> {
        for unit in self.units(level) {
            let (from, to) = (from.join(unit.path()), to.join(unit.path()));
            let parent = to.parent().unwrap_or(&to);
            fs::create_dir_all(parent).map_err(Error::io(parent))?;
            fs::rename(from, &to).map_err(Error::io(&to))?;
        }
        Ok(())
    }
}

/// Whether a file that begins so is an index.
pub(super) fn announced(first: &[u8]) -> bool {
    let first = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first);
    first.trim_ascii_start().starts_with(b"{") && first.windows(KNOWN_BY.len()).any(|word| word == KNOWN_BY)
}

/// Copies what is at `place` below `from`, but for `without`, links to folders, and what is no file.
fn copy(from: &Path, to: &Path, place: &Path, without: &[PathBuf], depth: usize) -> Result<()> {
    let folder = from.join(place);
    for entry in fs::read_dir(&folder).map_err(Error::io(&folder))? {
        let entry = entry.map_err(Error::io(&folder))?;
        let place = place.join(entry.file_name());
        let (source, target) = (from.join(&place), to.join(&place));
        if without.contains(&place) {
            continue;
        }
        if entry.file_type().map_err(Error::io(&source))?.is_dir() {
            if depth == 0 {
                let reason = format!("folders in each other {MAX_DEPTH} times, the limit");
                return Err(bad(&source, reason));
            }
            fs::create_dir(&target).map_err(Error::io(&target))?;
            copy(from, to, &place, without, depth - 1)?;
        } else if source.is_file() {
            fs::copy(&source, &target).map_err(Error::io(&source))?;
        }
    }
    Ok(())
}
