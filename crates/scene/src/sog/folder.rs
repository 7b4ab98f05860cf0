//! A SOG as it lies on servers: `meta.json` and its pictures in a folder, which is read as if it were bundled, and written
//! as a folder again, with every file but one as it was.
use crate::atomic_write::{write_folder_whole, write_whole};
use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::{Error, Result};
use std::fs;
use std::io::{self, BufReader, Cursor, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Most files in a folder: a SOG has eight, and maybe something beside them.
const MOST_FILES: usize = 64;

/// A folder as it was read.
#[derive(Debug)]
struct Folder {
    /// Of the same files, bundled.
    bundle: Arc<dyn Container>,
}

/// Reads the folder of a SOG within `memory` bytes.
pub(crate) fn read(path: &Path, bad_rows: BadRows, memory: u64) -> Result<(Gaussians, Arc<dyn Container>)> {
    let bundle = bundle(path, memory)?;
    let size = bundle.len() as u64;
    let (gaussians, bundle) = super::read(path, &mut BufReader::new(&bundle[..]), size, bad_rows, memory)?;
    Ok((gaussians, Arc::new(Folder { bundle })))
}

/// The files of a folder in a ZIP, by name.
fn bundle(path: &Path, memory: u64) -> Result<Vec<u8>> {
    let mut files = files(path)?;
    files.sort();
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut left = memory;
    for file in files {
        let size = fs::metadata(&file).map_err(Error::io(&file))?.len();
        left = left.checked_sub(size).ok_or_else(|| Error::DoesNotFit {
            path: path.into(),
            memory,
        })?;
        let name = file.file_name().and_then(|name| name.to_str());
        let name = name.ok_or_else(|| bad(&file, "a name that is not UTF-8".to_string()))?;
        let content = fs::read(&file).map_err(Error::io(&file))?;
        let put = zip.start_file(name, stored).map_err(io::Error::other);
        put.and_then(|()| zip.write_all(&content)).map_err(Error::io(&file))?;
    }
    let zip = zip.finish().map_err(io::Error::other).map_err(Error::io(path))?;
    Ok(zip.into_inner())
}

/// The regular files of a folder; what else there is belongs to no SOG.
fn files(path: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(Error::io(path))? {
        let file = entry.map_err(Error::io(path))?.path();
        if file.is_file() {
            files.push(file);
        }
        if files.len() > MOST_FILES {
            return Err(bad(
                path,
                format!("the folder of a SOG with more than {MOST_FILES} files, the limit"),
            ));
        }
    }
    Ok(files)
}

impl Container for Folder {
    fn format(&self) -> Format {
        Format::Sog
    }

    fn bytes(&self) -> usize {
        self.bundle.bytes()
    }

    fn exact(&self) -> bool {
        self.bundle.exact()
    }

    fn learnable_degree(&self, scene: usize) -> usize {
        self.bundle.learnable_degree(scene)
    }

    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        self.bundle.quantize_colors(row, coefficients);
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.bundle.ignored()
    }

    fn is_one_file(&self) -> bool {
        false
    }

    /// Bundled.
    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        self.bundle.write(sh, out)
    }

    /// As a folder, which must not be there yet; or bundled, where the name says that.
    fn write_at(&self, sh: &Sh, path: &Path) -> Result<()> {
        if Format::of_name(path) == Some(Format::Sog) {
            return write_whole(path, |out| self.write(sh, out));
        }
        write_folder_whole(path, |aside| self.write_folder(sh, aside).map_err(Error::io(path)))
    }
}

impl Folder {
    fn write_folder(&self, sh: &Sh, aside: &Path) -> io::Result<()> {
        let mut file = Vec::new();
        self.bundle.write(sh, &mut file)?;
        let mut zip = ZipArchive::new(Cursor::new(file)).map_err(io::Error::other)?;
        for i in 0..zip.len() {
            let mut entry = zip.by_index(i).map_err(io::Error::other)?;
            // All names are those of files that lay in one folder.
            let name = entry.name().map_err(io::Error::other)?.into_owned();
            let name = Path::new(&name).file_name().unwrap_or_default();
            let mut out = fs::File::create_new(aside.join(name))?;
            io::copy(&mut entry, &mut out)?;
            out.sync_all()?;
        }
        Ok(())
    }
}
