//! SuperSplat's compressed PLY: chunks of 256 Gaussians, whose properties are whole fractions of the chunk's ranges,
//! packed into four words.
//!
//! Element chunk has the ranges of positions, log scales and, from newer writers, of colours; element vertex the
//! words; element sh, if any, a byte for each coefficient above the constant one. A written file differs from the one
//! read in nothing but the ranges of colours in the chunks and the bytes of colours: the header, the order of
//! everything, other elements and properties and anything after them keep their bytes. With the colours that were
//! read it is the file that was read.
pub(crate) mod decode;
mod grid;
pub(crate) mod layout;
pub(crate) mod rest;

use crate::Result;
use crate::container::{Container, Format};
use crate::error::bad;
use crate::fields::file_index;
use crate::gaussians::{Gaussians, Sh};
use crate::range::Range;
use crate::summary::Summary;
use decode::{Chunk, word};
use layout::Layout;
use ply_rs::ply::Header;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// Gaussians of a chunk; the last may have fewer.
pub(crate) const CHUNK: usize = 256;

/// A compressed PLY as it was read.
#[derive(Debug)]
struct Packed {
    header: Vec<u8>,
    layout: Layout,
    body: Vec<u8>,
    chunks: Vec<Chunk>,
    /// The ranges of colours in a file whose colours were changed.
    grids: Vec<[Range; 3]>,
}

/// Whether a PLY of this header is compressed.
pub(crate) fn announced(header: &Header) -> bool {
    let vertex = header.elements.get("vertex");
    vertex.is_some_and(|vertex| vertex.properties.contains_key("packed_position"))
}

/// Reads what follows the header, `left` bytes; `path` is for messages.
pub(crate) fn read(
    path: &Path,
    header: Vec<u8>,
    parsed: &Header,
    source: &mut BufReader<impl Read>,
    left: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let reason = |reason| bad(path, reason);
    let layout = Layout::find(parsed).map_err(reason)?;
    layout.check_size(left).map_err(reason)?;
    let body = crate::remaining::read_remaining(path, source, left)?;
    // Again, since a file can shrink between the look at its size and the read.
    layout.check_size(body.len() as u64).map_err(reason)?;
    let chunks = decode::chunks(&layout, &body).map_err(reason)?;
    let gaussians = decode::decode(&layout, &chunks, &body).map_err(reason)?;
    let grids = grid::grids(&layout, &chunks, &body);
    let packed = Packed {
        header,
        layout,
        body,
        chunks,
        grids,
    };
    Ok((gaussians, Arc::new(packed)))
}

/// What the header of a file of `size` bytes says, `left` of which follow it; `Err` is the reason for which it is none.
pub(crate) fn summary(parsed: &Header, size: u64, left: u64) -> Result<Summary, String> {
    let layout = Layout::find(parsed)?;
    layout.check_size(left)?;
    Ok(Summary {
        format: Format::CompressedPly,
        gaussians: layout.gaussians.count as u64,
        degree: layout.degree as u64,
        file: size,
    })
}

impl Packed {
    /// Where the coefficients of a row of [`Sh`] after the first three are in a row of element sh.
    fn rest_columns(&self, sh: &Sh) -> Vec<usize> {
        let Some((_, columns)) = &self.layout.rest else {
            return Vec::new();
        };
        let places = 3..sh.per_gaussian();
        places
            .map(|place| columns[file_index(self.layout.degree, place) - 3])
            .collect()
    }

    /// Whether these are the colours of the file.
    fn has(&self, sh: &Sh) -> bool {
        let columns = self.rest_columns(sh);
        let mut rests = self.layout.rest.as_ref().map(|(table, _)| table.rows(&self.body));
        let rows = self
            .layout
            .gaussians
            .rows(&self.body)
            .zip(sh.coefficients.chunks_exact(sh.per_gaussian()));
        rows.enumerate().all(|(i, (row, colour))| {
            let bytes = word(row, self.layout.words[3]).to_be_bytes();
            let ranges = &self.chunks[i / CHUNK].colour;
            let rest = rests.as_mut().and_then(Iterator::next).unwrap_or_default();
            (0..3).all(|k| ranges[k].coefficient(bytes[k]) == colour[k])
                && columns
                    .iter()
                    .zip(&colour[3..])
                    .all(|(column, value)| rest::value(rest[*column]) == *value)
        })
    }

    /// Puts colours into the body, on the steps of the new ranges.
    fn patch(&self, sh: &Sh, body: &mut [u8]) {
        if let Some(columns) = self.layout.colour {
            for (row, grid) in self.layout.chunks.rows_mut(body).zip(&self.grids) {
                let ends = grid
                    .iter()
                    .map(|range| range.min)
                    .chain(grid.iter().map(|range| range.max));
                for (column, end) in columns.into_iter().zip(ends) {
                    row[column..column + 4].copy_from_slice(&end.to_le_bytes());
                }
            }
        }
        let column = self.layout.words[3];
        let colours = || sh.coefficients.chunks_exact(sh.per_gaussian());
        for (i, (row, colour)) in self.layout.gaussians.rows_mut(body).zip(colours()).enumerate() {
            let mut bytes = word(row, column).to_be_bytes();
            for ((byte, range), value) in bytes.iter_mut().zip(&self.grids[i / CHUNK]).zip(colour) {
                *byte = range.nearest(*value);
            }
            row[column..column + 4].copy_from_slice(&u32::from_be_bytes(bytes).to_le_bytes());
        }
        if let Some((table, _)) = &self.layout.rest {
            let columns = self.rest_columns(sh);
            for (row, colour) in table.rows_mut(body).zip(colours()) {
                for (column, value) in columns.iter().zip(&colour[3..]) {
                    row[*column] = rest::nearest(*value);
                }
            }
        }
    }
}

impl Container for Packed {
    fn format(&self) -> Format {
        Format::CompressedPly
    }

    fn bytes(&self) -> usize {
        self.header.len() + self.body.len() + size_of_val(&self.chunks[..]) + size_of_val(&self.grids[..])
    }

    fn exact(&self) -> bool {
        false
    }

    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        let (constant, rest) = coefficients.split_at_mut(3);
        for (value, range) in constant.iter_mut().zip(&self.grids[row / CHUNK]) {
            *value = range.coefficient(range.nearest(*value));
        }
        for value in rest {
            *value = rest::value(rest::nearest(*value));
        }
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&self.header)?;
        if self.has(sh) {
            return out.write_all(&self.body);
        }
        let mut body = self.body.clone();
        self.patch(sh, &mut body);
        out.write_all(&body)
    }
}

#[cfg(test)]
mod tests;
