//! Niantic's SPZ, versions 2, 3 and 4: every attribute in a section of its own, fixed point or 8 bits a number.
//!
//! Versions 2 and 3 are one gzip stream, version 4 a header and a zstd stream a section. The numbers mean the same in
//! all of them, see [`attributes`] and [`colour`]; version 1 had half floats for positions and was never released.
//!
//! **Axes.** In memory are the numbers of the file: axes are not flipped on the way. The format says that its axes are
//! right, up, back, where those of a PLY usually are right, down, front, and Niantic's library converts only where it
//! is told both. Tools differ: Niantic's command line programs and gsply copy the numbers from and to PLY, and so a
//! PLY that they made of an SPZ is that SPZ in memory; splat-transform turns scenes half around x, and its PLY is the
//! SPZ turned so. Nothing in a file tells which way it came, short of Adobe's extension, which is kept as it is.
//!
//! **What is kept.** Flags (such as that of antialiasing), reserved bytes, extensions and whatever follows the
//! Gaussians. Every byte is a colour, so that a file has 8 bits for each coefficient, also where its writer rounded
//! spherical harmonics to 5 or 4.
mod attributes;
pub(crate) mod colour;
mod gzip;
pub(crate) mod header;
pub(crate) mod limits;
mod streams;

use crate::Result;
use crate::container::{Container, Format};
use crate::gaussians::Gaussians;
use crate::summary::Summary;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;

/// Whether a file with these first bytes is to be read as SPZ, be it only to say what is wrong with it.
pub(crate) fn is_spz(first: &[u8]) -> bool {
    first.starts_with(&gzip::MAGIC) || first.starts_with(&header::MAGIC)
}

/// Reads a file of `size` bytes, for whose first ones [`is_spz`] holds; `path` is for messages.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    if source.buffer().starts_with(&gzip::MAGIC) {
        gzip::read(path, source, size)
    } else {
        streams::read(path, source, size)
    }
}

/// What the head of a file of `size` bytes says, for which [`is_spz`] holds; `Err` is the reason for which it is none.
pub(crate) fn summary(head: &[u8], size: u64) -> Result<Summary, String> {
    let (header, file) = if head.starts_with(&gzip::MAGIC) {
        gzip::header(head, size)?
    } else {
        streams::header(head, size)?
    };
    Ok(Summary {
        format: Format::Spz,
        gaussians: header.points as u64,
        degree: header.degree as u64,
        file,
    })
}

#[cfg(test)]
mod tests;
