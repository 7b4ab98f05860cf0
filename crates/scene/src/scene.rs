//! A scene and the file it came from, whatever its format.
use crate::atomic_write::write_whole;
use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::sniff::{announced, is_loose_sog, not_a_file};
use crate::{Error, Result, gltf, ksplat, ply, sog, splat, spz};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// A scene: what the engine computes with, and the file it came from.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The Gaussians in the order of the file, without the rows of [`Scene::ignored`]. The degree of their colours is
    /// that of the highest band in which any Gaussian has a coefficient other than 0, which may be lower than what the
    /// file has room for.
    pub gaussians: Gaussians,
    /// `None` for a scene that was not read from a file.
    source: Option<Arc<dyn Container>>,
}

impl Scene {
    /// Reads a scene. The format is told by the content, not by the name.
    ///
    /// A file of no Gaussians is read; marking and viewing it is what fails. Memory: the file's size for its bytes,
    /// and about as much for the numbers in them; for compressed formats both as large as the bytes uncompressed.
    ///
    /// # Errors
    /// [`Error::Io`] where reading fails. [`Error::BadScene`], with property, row and limit: not a scene of a known
    /// format, properties missing, twice or not numbers, fewer rows than promised, NaN in a used property, infinities
    /// other than those of opacity and of flat axes (a log scale of minus infinity), more bytes uncompressed than
    /// allowed. Counts are compared with the file before anything is allocated.
    pub fn read(path: &Path) -> Result<Scene> {
        Scene::read_with(path, BadRows::Refuse)
    }

    /// Reads a scene as [`Scene::read`], in which values that are not legal may be no reason to refuse it, but to leave
    /// their rows out: [`Scene::ignored`] tells of them.
    ///
    /// Only what is wrong with a single row is ignored: NaN and infinities of PLY and `.splat`, words that are no
    /// numbers in an ASCII PLY, negative deviations in a `.splat`, and indices that stand for no number in a SOG. What
    /// many rows share (a chunk's range, the numbers of `meta.json`) and whatever leaves in doubt where rows are is
    /// refused all the same. No byte of an SPZ can be wrong.
    ///
    /// # Errors
    /// Those of [`Scene::read`]; [`Error::BadScene`] where no row is left.
    pub fn read_with(path: &Path, bad_rows: BadRows) -> Result<Scene> {
        Scene::read_within(path, bad_rows, u64::MAX)
    }

    /// Reads a scene as [`Scene::read_with`], and stops before it takes more than `memory` bytes, where the head of the
    /// file does not tell how many it will take: that is so of SOG and glTF. Of all other formats
    /// [`summary`](crate::summary()) tells before anything is read.
    ///
    /// # Errors
    /// Those of [`Scene::read_with`]; [`Error::DoesNotFit`].
    pub fn read_within(path: &Path, bad_rows: BadRows, memory: u64) -> Result<Scene> {
        Scene::open(path, bad_rows, memory, None)
    }

    /// Reads a scene as [`Scene::read_within`], and the files in its folder that it refers to: a glTF may have its
    /// buffers there. The path may also be the folder of a SOG that is not bundled, or of one that is
    /// streamed, or the `lod-meta.json` of that: then its finest level of detail is read. Only for files that their user chose on this machine: who hands in a file chooses what is read.
    ///
    /// # Errors
    /// Those of [`Scene::read_within`]; [`Error::BadScene`] for references to anything that is not in the folder or
    /// below it.
    pub fn read_with_files(path: &Path, bad_rows: BadRows, memory: u64) -> Result<Scene> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Scene::open(path, bad_rows, memory, Some(folder))
    }

    /// Reads a scene as [`Scene::read_with_files`]; of a streamed SOG this level of detail of all tiles, 0 being the finest.
    ///
    /// # Errors
    /// Those of [`Scene::read_with_files`]; [`Error::BadScene`] for a level that the scene has not.
    pub fn read_level(path: &Path, level: usize, bad_rows: BadRows, memory: u64) -> Result<Scene> {
        match sog::StreamedSog::open(path)? {
            Some(streamed) => streamed.read(level, bad_rows, memory),
            None if level > 0 => Err(bad(
                path,
                format!("no level {level}: only a SOG with a lod-meta.json has levels of detail"),
            )),
            None => Scene::read_with_files(path, bad_rows, memory),
        }
    }

    fn open(path: &Path, bad_rows: BadRows, memory: u64, folder: Option<&Path>) -> Result<Scene> {
        if folder.is_some()
            && let Some(streamed) = sog::StreamedSog::open(path)?
        {
            return streamed.read(0, bad_rows, memory);
        }
        if folder.is_some() && is_loose_sog(path) {
            return Scene::of(path, sog::read_folder(path, bad_rows, memory)?);
        }
        let file = File::open(path).map_err(Error::io(path))?;
        let metadata = file.metadata().map_err(Error::io(path))?;
        if !metadata.is_file() {
            return Err(not_a_file(path));
        }
        let mut source = BufReader::with_capacity(1 << 16, file);
        Scene::read_from(path, &mut source, metadata.len(), bad_rows, memory, folder)
    }

    /// Reads a scene from memory; `name` is for messages.
    ///
    /// # Errors
    /// Those of [`Scene::read`].
    pub fn parse(name: &Path, bytes: &[u8]) -> Result<Scene> {
        Scene::parse_with(name, bytes, BadRows::Refuse)
    }

    /// Reads a scene from memory as [`Scene::read_with`]; `name` is for messages.
    ///
    /// # Errors
    /// Those of [`Scene::read_with`].
    pub fn parse_with(name: &Path, bytes: &[u8], bad_rows: BadRows) -> Result<Scene> {
        let size = bytes.len() as u64;
        Scene::read_from(name, &mut BufReader::new(bytes), size, bad_rows, u64::MAX, None)
    }

    /// Reads a scene of `size` bytes within `memory` bytes, and files that it refers to from `folder`, if that is given;
    /// `path` is for messages.
    fn read_from(
        path: &Path,
        source: &mut BufReader<impl Read>,
        size: u64,
        bad_rows: BadRows,
        memory: u64,
        folder: Option<&Path>,
    ) -> Result<Scene> {
        // The file system may give fewer bytes at first, but a buffer of an empty file only.
        let first = source.fill_buf().map_err(Error::io(path))?;
        let read = match announced(first) {
            Some(Format::Ply | Format::CompressedPly) => ply::read(path, source, size, bad_rows)?,
            Some(Format::Spz) => spz::read(path, source, size)?,
            Some(Format::Sog) => sog::read(path, source, size, bad_rows, memory)?,
            Some(Format::Gltf | Format::Glb) => gltf::read(path, source, size, bad_rows, memory, folder)?,
            Some(Format::Ksplat) => ksplat::read(path, source, size, bad_rows)?,
            _ => splat::read(path, source, size, bad_rows)?,
        };
        Scene::of(path, read)
    }

    /// What was read, of which some row must be left.
    pub(crate) fn of(path: &Path, (gaussians, source): (Gaussians, Arc<dyn Container>)) -> Result<Scene> {
        if let Some(ignored) = source.ignored().filter(|_| gaussians.is_empty()) {
            let (count, first) = (ignored.count(), ignored.first());
            return Err(bad(
                path,
                format!("none of {count} rows is left, the first since {first}"),
            ));
        }
        Ok(Scene {
            gaussians,
            source: Some(source),
        })
    }

    /// Writes the scene with the colours `sh` in place of its own, whole or not at all, in the format that it was
    /// read from.
    ///
    /// A scene from a file is written as that file with its colours changed, rows that were ignored as they were,
    /// whatever else was done to [`Scene::gaussians`]; one that was made in memory, as a PLY in the layout of the reference implementation.
    ///
    /// # Errors
    /// [`Error::BadScene`] where `sh` has another degree or number of rows than the scene, or a value that is not
    /// finite; [`Error::Io`] where writing fails, the disk being full included.
    pub fn write(&self, path: &Path, sh: &Sh) -> Result<()> {
        let own = &self.gaussians.sh;
        if sh.degree != own.degree || sh.coefficients.len() != own.coefficients.len() {
            let sizes = (sh.degree, sh.coefficients.len(), own.degree, own.coefficients.len());
            let (degree, count, own_degree, own_count) = sizes;
            return Err(bad(
                path,
                format!("colours of degree {degree} with {count} values; the scene has {own_degree} and {own_count}"),
            ));
        }
        if let Some(i) = sh.coefficients.iter().position(|v| !v.is_finite()) {
            let (row, value) = (i / sh.per_gaussian(), sh.coefficients[i]);
            return Err(bad(path, format!("a colour of row {row} would be {value}")));
        }
        match &self.source {
            Some(source) => source.write_at(sh, path),
            None => write_whole(path, |out| self.encode(sh, out)),
        }
    }

    /// Whether all of it is in one file. Otherwise [`Scene::write`] writes files beside, named after the one at its path,
    /// and [`Scene::encode`] fails.
    pub fn is_one_file(&self) -> bool {
        self.source.as_ref().is_none_or(|source| source.is_one_file())
    }

    /// The bytes that [`Scene::write`] puts into a file, for colours that it would not refuse.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn encode(&self, sh: &Sh, mut out: &mut dyn Write) -> std::io::Result<()> {
        match &self.source {
            Some(source) => source.write(sh, out),
            None => ply::write_standard(&self.gaussians, sh, &mut out),
        }
    }

    /// A scene without a file; it is written as a PLY in the layout of the reference implementation.
    pub fn from_gaussians(gaussians: Gaussians) -> Scene {
        Scene {
            gaussians,
            source: None,
        }
    }

    /// The Gaussians alone: what else is kept of the file, which is as large, is let go at once.
    pub fn into_gaussians(self) -> Gaussians {
        self.gaussians
    }

    /// The format that [`Scene::write`] writes.
    pub fn format(&self) -> Format {
        self.source.as_ref().map_or(Format::Ply, |source| source.format())
    }

    /// The rows of the file that were left out, if any.
    pub fn ignored(&self) -> Option<&Ignored> {
        self.source.as_ref().and_then(|source| source.ignored())
    }

    /// Bytes of the file that are in memory, uncompressed.
    pub fn file_bytes(&self) -> usize {
        self.source.as_ref().map_or(0, |source| source.bytes())
    }

    /// Whether a written file keeps every finite colour as it is. Otherwise [`Scene::keep`] tells what it keeps.
    pub fn exact(&self) -> bool {
        self.source.as_ref().is_none_or(|source| source.exact())
    }

    /// Highest degree of spherical harmonics whose coefficients a written file can have changed for each Gaussian by
    /// itself; those above are written as they were read.
    pub fn learnable_degree(&self) -> usize {
        let degree = self.gaussians.sh.degree;
        self.source
            .as_ref()
            .map_or(degree, |s| s.learnable_degree(degree).min(degree))
    }

    /// Replaces the coefficients of Gaussian `row`, laid out as a row of [`Sh`], by what a written file keeps of them.
    pub fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        if let Some(source) = &self.source {
            source.quantize_colors(row, coefficients);
        }
    }
}
