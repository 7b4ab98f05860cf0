//! Scenes: Gaussians in memory, and the 3DGS PLY files they come from.
//!
//! Files are read as the tools write them: binary of either byte order or ASCII, spherical harmonics of degree 0 to
//! 4. A written file differs from the one read in nothing but the values of `f_dc_*` and `f_rest_*`: the header with
//! its comments, the order of rows, other properties and anything after the Gaussians keep their bytes.
mod body;
mod fields;
mod gaussians;
mod header;
mod standard;
mod whole;

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

pub use gaussians::{Gaussians, MAX_DEGREE, Sh};
pub(crate) use whole::write_whole;

/// A scene: what the engine computes with, and the file it came from.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The Gaussians in the order of the file.
    pub gaussians: Gaussians,
    /// `None` for a scene that was not read from a file.
    source: Option<Source>,
}

/// A file as it was read.
#[derive(Clone, Debug)]
struct Source {
    header: Vec<u8>,
    layout: header::Layout,
    body: Vec<u8>,
}

impl Scene {
    /// Reads a 3DGS PLY.
    ///
    /// A file of no Gaussians is read; marking and viewing it is what fails, in
    /// [`Extent::of`](crate::view::Extent::of). Memory: the file's size for its bytes, and about as much for the
    /// numbers in them.
    ///
    /// # Errors
    /// [`Error::Io`] where reading fails. [`Error::BadScene`], with property, row and limit: not a PLY, a header over
    /// 64 KiB, properties missing, twice or not numbers, a number of `f_rest` properties other than 0, 9, 24, 45 or
    /// 72, fewer rows than promised, NaN in a used property, infinities other than those of opacity and of flat axes
    /// (a log scale of minus infinity). Counts are compared with the file before anything is allocated.
    pub fn read(path: &Path) -> Result<Scene> {
        let file = File::open(path).map_err(Error::io(path))?;
        let metadata = file.metadata().map_err(Error::io(path))?;
        if !metadata.is_file() {
            return Err(bad(path, "not a regular file".to_string()));
        }
        Scene::read_from(path, &mut BufReader::with_capacity(1 << 16, file), metadata.len())
    }

    /// Reads a scene of `size` bytes; `path` is for messages.
    fn read_from(path: &Path, source: &mut BufReader<impl Read>, size: u64) -> Result<Scene> {
        let header = header::read_header(source).map_err(Error::io(path))?;
        let header = header.map_err(|reason| bad(path, reason))?;
        let layout = header::parse(&header).map_err(|reason| bad(path, reason))?;
        let left = size.saturating_sub(header.len() as u64);
        layout.check_size(left).map_err(|reason| bad(path, reason))?;
        let mut body = Vec::new();
        usize::try_from(left)
            .ok()
            .and_then(|left| body.try_reserve_exact(left).ok())
            .ok_or_else(|| bad(path, format!("{left} bytes of Gaussians do not fit in memory")))?;
        // A file that grows while it is read is read up to the size it had.
        source.take(left).read_to_end(&mut body).map_err(Error::io(path))?;
        let gaussians = body::decode(&layout, &body).map_err(|reason| bad(path, reason))?;
        Ok(Scene {
            gaussians,
            source: Some(Source { header, layout, body }),
        })
    }

    /// Writes the scene with the colours `sh` in place of its own, whole or not at all.
    ///
    /// A scene from a file is written as that file with `f_dc_*` and `f_rest_*` changed, whatever else was done to
    /// [`Scene::gaussians`]; one that was made in memory, in the layout of the reference implementation.
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
        write_whole(path, |mut out| match &self.source {
            Some(source) => {
                out.write_all(&source.header)?;
                body::encode(&source.layout, &source.body, sh, &mut out)
            }
            None => standard::write(&self.gaussians, sh, &mut out),
        })
    }

    /// A scene without a file; it is written in the layout of the reference implementation.
    pub fn from_gaussians(gaussians: Gaussians) -> Scene {
        Scene {
            gaussians,
            source: None,
        }
    }
}

fn bad(path: &Path, reason: String) -> Error {
    Error::BadScene {
        path: path.into(),
        reason,
    }
}

#[cfg(test)]
mod tests;
