//! 3DGS PLY files as the tools write them: binary of either byte order or ASCII, spherical harmonics of degree 0 to 4.
//!
//! A written file differs from the one read in nothing but the values of `f_dc_*` and `f_rest_*`: the header with
//! its comments, the order of rows, other properties and anything after the Gaussians keep their bytes.
mod body;
mod fields;
mod header;
mod standard;

use crate::container::{Container, Format};
use crate::gaussians::{Gaussians, Sh};
use crate::scene::bad;
use crate::{Error, Result};
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

pub(crate) use standard::write as write_standard;

/// A PLY as it was read.
#[derive(Debug)]
struct Ply {
    header: Vec<u8>,
    layout: header::Layout,
    body: Vec<u8>,
}

/// Reads a PLY of `size` bytes from its first byte; `path` is for messages.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let header = header::read_header(source).map_err(Error::io(path))?;
    let header = header.map_err(|reason| bad(path, reason))?;
    let layout = header::parse(&header).map_err(|reason| bad(path, reason))?;
    let left = size.saturating_sub(header.len() as u64);
    layout.check_size(left).map_err(|reason| bad(path, reason))?;
    let body = rest(path, source, left)?;
    let gaussians = body::decode(&layout, &body).map_err(|reason| bad(path, reason))?;
    Ok((gaussians, Arc::new(Ply { header, layout, body })))
}

/// The `left` bytes that a source should still have, or as many as it has: one that grows while it is read is read up
/// to the size it had.
pub(crate) fn rest(path: &Path, source: &mut BufReader<impl Read>, left: u64) -> Result<Vec<u8>> {
    let mut body = Vec::new();
    usize::try_from(left)
        .ok()
        .and_then(|left| body.try_reserve_exact(left).ok())
        .ok_or_else(|| bad(path, format!("{left} bytes of Gaussians do not fit in memory")))?;
    source.take(left).read_to_end(&mut body).map_err(Error::io(path))?;
    Ok(body)
}

impl Container for Ply {
    fn format(&self) -> Format {
        Format::Ply
    }

    fn write(&self, sh: &Sh, mut out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&self.header)?;
        body::encode(&self.layout, &self.body, sh, &mut out)
    }
}

#[cfg(test)]
mod tests;
