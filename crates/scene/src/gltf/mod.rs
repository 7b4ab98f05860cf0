//! glTF 2.0 with splats (KHR_gaussian_splatting): JSON with its buffers in it or beside it, and binary files.
//!
//! Every primitive of splats that the scene shows is read, in the order of the file, into one scene, at the place where
//! its node puts it: positions, rotations, scales and spherical harmonics are those of the world. A written file has
//! other coefficients at the places of the old ones, turned back into the spaces of their nodes; coefficients that are as
//! they were read keep their bytes, and so does everything else, to the spaces of the JSON.
//!
//! Splats may also be an SPZ in a buffer view (KHR_gaussian_splatting_compression_spz). A new one has another length,
//! and so offsets of what follows it in its buffer change with it.
//!
//! `COLOR_0`, with which programs show splats that do not know them, stays as it is.
//!
//! The crate `gltf` is not used: its last release (1.4.1) is of 2024, it knows neither the extension nor attributes whose
//! names have a colon, and it keeps no place of anything in the text.
mod accessor;
mod buffers;
mod cameras;
mod document;
mod envelope;
mod harmonics;
mod part;
mod placement;
pub(crate) mod primitive;
mod read;
mod sharing;
mod spans;
mod splats;
mod splice;
mod write;

pub use cameras::{GltfCamera, gltf_cameras, is_binary_gltf};
pub(crate) use harmonics::Turn;
pub(crate) use placement::{Placement, matrix};

use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::remaining::read_remaining;
use crate::{Error, Result};
use buffers::{Buffer, Place, Sources};
use envelope::Envelope;
use part::{Colours, Part};
use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// A file as it was read.
#[derive(Debug)]
struct File {
    envelope: Envelope,
    /// Those that splats are in.
    buffers: BTreeMap<usize, Buffer>,
    parts: Vec<Part>,
    ignored: Ignored,
    /// That of the scene's spherical harmonics.
    degree: usize,
}

/// The format that first bytes announce: binary files by their magic, others as text that begins like a JSON object.
pub(crate) fn announced(first: &[u8]) -> Option<Format> {
    if first.starts_with(&envelope::MAGIC) {
        return Some(Format::Glb);
    }
    // A .splat may begin in any way, but not with text only.
    let text = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first);
    let start = &text[..text.len().min(64)];
    let object = start.trim_ascii_start().strip_prefix(b"{")?.trim_ascii_start();
    let readable = |byte: &u8| !byte.is_ascii_control() || byte.is_ascii_whitespace();
    let begins = matches!(object.first(), Some(b'"' | b'}'));
    (begins && start.iter().all(readable)).then_some(Format::Gltf)
}

/// Reads a file of `size` bytes within `memory` bytes, for which [`announced`] says that it is one; `path` is for
/// messages. Files beside it are read from `folder`, if that is given.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
    bad_rows: BadRows,
    memory: u64,
    folder: Option<&Path>,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let does_not_fit = || Error::DoesNotFit {
        path: path.into(),
        memory,
    };
    if size > memory {
        return Err(does_not_fit());
    }
    let file = read_remaining(path, source, size)?;
    match read::parse(file, bad_rows, &Sources { folder, memory }) {
        Ok((gaussians, file)) => Ok((gaussians, Arc::new(file))),
        Err(read::Failure::Bad(reason)) => Err(bad(path, reason)),
        Err(read::Failure::DoesNotFit) => Err(does_not_fit()),
    }
}

impl File {
    fn buffer(&self, index: usize) -> &[u8] {
        let buffer = self.buffers.get(&index);
        buffer.map_or(&[], |buffer| buffer.bytes(&self.envelope))
    }

    /// The part that has a row of the file.
    fn part(&self, file_row: usize) -> Option<usize> {
        // Parts without a row begin where the next one does.
        let after = self.parts.partition_point(|part| part.first <= file_row);
        after.checked_sub(1)
    }
}

impl Container for File {
    fn format(&self) -> Format {
        self.envelope.format
    }

    fn bytes(&self) -> usize {
        let own: usize = self.buffers.values().map(Buffer::own_bytes).sum();
        let streams = self.parts.iter().map(|part| match &part.colours {
            Colours::Attributes(_) => 0,
            Colours::Spz(stream) => stream.file.bytes() + size_of_val(&stream.sh.coefficients[..]),
        });
        self.envelope.file.len() + own + streams.sum::<usize>()
    }

    fn exact(&self) -> bool {
        self.parts.iter().all(|part| part.exact(self.degree))
    }

    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        let file_row = self.ignored.file_row(row);
        if let Some(part) = self.part(file_row).map(|index| &self.parts[index]) {
            part.quantize(|buffer| self.buffer(buffer), file_row - part.first, coefficients);
        }
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.ignored.if_any()
    }

    fn is_one_file(&self) -> bool {
        self.buffers
            .values()
            .all(|buffer| !matches!(buffer.place, Place::Beside { .. }))
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        if !self.is_one_file() {
            return Err(io::Error::other(
                "a glTF with buffers in other files cannot be written as one",
            ));
        }
        self.write_main(self.changed(sh)?, &BTreeMap::new(), out)
    }

    fn write_at(&self, sh: &Sh, path: &Path) -> Result<()> {
        self.write_files(sh, path)
    }
}

#[cfg(test)]
mod tests;
