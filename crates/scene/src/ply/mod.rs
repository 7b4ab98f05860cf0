//! 3DGS PLY files as the tools write them: binary of either byte order or ASCII, spherical harmonics of degree 0 to 4.
//!
//! A written file differs from the one read in nothing but the values of `f_dc_*` and `f_rest_*`: the header with
//! its comments, the order of rows, other properties and anything after the Gaussians keep their bytes.
mod body;
pub(crate) mod header;
mod layout;
mod standard;

use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::remaining::read_remaining;
use crate::summary::Summary;
use crate::{Error, Result, packed};
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

pub(crate) use standard::write as write_standard;

/// A PLY as it was read.
#[derive(Debug)]
struct Ply {
    header: Vec<u8>,
    layout: layout::Layout,
    body: Vec<u8>,
    ignored: Ignored,
}

/// Whether a file that begins with these bytes is a PLY, if one that may be damaged.
pub(crate) fn begins(first: &[u8]) -> bool {
    first
        .strip_prefix(b"ply")
        .is_some_and(|next| next.first().is_none_or(u8::is_ascii_whitespace))
}

/// Reads a PLY of `size` bytes from its first byte, plain or compressed; `path` is for messages.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
    bad_rows: BadRows,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let header = header::read_header(source).map_err(Error::io(path))?;
    let header = header.map_err(|reason| bad(path, reason))?;
    let parsed = header::parse(&header).map_err(|reason| bad(path, reason))?;
    let left = size.saturating_sub(header.len() as u64);
    if packed::announced(&parsed) {
        return packed::read(path, header, &parsed, source, left);
    }
    let layout = layout::Layout::find(&parsed).map_err(|reason| bad(path, reason))?;
    layout.check_size(left).map_err(|reason| bad(path, reason))?;
    let body = read_remaining(path, source, left)?;
    let (gaussians, ignored) = body::decode(&layout, &body, bad_rows).map_err(|reason| bad(path, reason))?;
    let ply = Ply {
        header,
        layout,
        body,
        ignored,
    };
    Ok((gaussians, Arc::new(ply)))
}

/// What the head of a PLY of `size` bytes says, plain or compressed; `Err` is the reason for which it is none.
pub(crate) fn summary(mut head: &[u8], size: u64) -> Result<Summary, String> {
    let header = header::read_header(&mut head).map_err(|error| error.to_string())??;
    let parsed = header::parse(&header)?;
    let left = size.saturating_sub(header.len() as u64);
    if packed::announced(&parsed) {
        return packed::summary(&parsed, size, left);
    }
    let layout = layout::Layout::find(&parsed)?;
    layout.check_size(left)?;
    Ok(Summary {
        format: Format::Ply,
        gaussians: layout.rows,
        degree: layout.fields.degree as u64,
        file: size,
    })
}

impl Container for Ply {
    fn format(&self) -> Format {
        Format::Ply
    }

    fn bytes(&self) -> usize {
        self.header.len() + self.body.len()
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.ignored.if_any()
    }

    fn write(&self, sh: &Sh, mut out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&self.header)?;
        body::encode(&self.layout, &self.body, sh, &self.ignored, &mut out)
    }
}

#[cfg(test)]
mod tests;
