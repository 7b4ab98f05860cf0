//! Version 4: a header, extensions and a table of contents in plain bytes, then a zstd stream for each section.
use super::header::{COLOURS, HARMONICS, HEADER, Header, SECTIONS, word};
use super::{attributes, colour, limits};
use crate::Result;
use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::remaining::read_remaining;
use std::io::{self, BufReader, Read, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use zstd::bulk;

const VERSIONS: [u32; 1] = [4];
/// Bytes of the whole header; the last twelve are reserved.
const WHOLE_HEADER: usize = 32;
/// Bytes of an entry of the table of contents: size compressed, size uncompressed.
const ENTRY: usize = 16;
/// What the reference implementation compresses with.
const LEVEL: i32 = 12;

/// A file as it was read.
#[derive(Debug)]
struct Streams {
    header: Header,
    file: Vec<u8>,
    layout: Layout,
    /// The section of colours, uncompressed.
    colours: Vec<u8>,
    /// That of spherical harmonics.
    harmonics: Vec<u8>,
}

/// Where things are in a file.
#[derive(Clone, Debug)]
struct Layout {
    /// First byte of the table of contents.
    toc: usize,
    /// The compressed sections, one after the other; sections of no bytes have no stream and no entry.
    streams: [Range<usize>; 6],
}

/// Reads a file of `size` bytes.
pub(super) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let file = read_remaining(path, source, size)?;
    let (gaussians, streams) = parse(file).map_err(|reason| bad(path, reason))?;
    Ok((gaussians, Arc::new(streams)))
}

/// The header at the start of a file of `size` bytes, and the bytes that are kept of it: those that are there, and
/// colours uncompressed. `Err` is the reason for which there is none.
pub(super) fn header(head: &[u8], size: u64) -> Result<(Header, u64), String> {
    let header = begin(head, size)?;
    let sizes = header.sections();
    Ok((header, size.saturating_add(sizes[COLOURS] + sizes[HARMONICS])))
}

/// The header, if the `size` of the file allows as many bytes as it promises.
fn begin(head: &[u8], size: u64) -> Result<Header, String> {
    let Some(start) = head.first_chunk::<HEADER>().filter(|_| head.len() >= WHOLE_HEADER) else {
        let there = head.len();
        return Err(format!("truncated: {there} bytes of a header of {WHOLE_HEADER}"));
    };
    let header = Header::parse(start, &VERSIONS, "a file without gzip")?;
    limits::check(header.sections().iter().sum(), size)?;
    Ok(header)
}

/// Understands a whole file; `Err` is the reason why not.
fn parse(file: Vec<u8>) -> Result<(Gaussians, Streams), String> {
    let header = begin(&file, file.len() as u64)?;
    let sizes = header.sections();
    let layout = Layout::find(&file, &sizes)?;
    let mut sections: [Vec<u8>; 6] = Default::default();
    for i in 0..sections.len() {
        sections[i] = decompress(&file[layout.streams[i].clone()], sizes[i] as usize)
            .map_err(|reason| format!("the stream of {} {reason}", SECTIONS[i]))?;
    }
    let gaussians = attributes::decode(&header, std::array::from_fn(|i| sections[i].as_slice()));
    let streams = Streams {
        header,
        layout,
        colours: std::mem::take(&mut sections[COLOURS]),
        harmonics: std::mem::take(&mut sections[HARMONICS]),
        file,
    };
    Ok((gaussians, streams))
}

impl Layout {
    /// Finds the streams of sections with these sizes; `Err` names what does not fit.
    fn find(file: &[u8], sizes: &[u64; 6]) -> Result<Layout, String> {
        let length = file.len();
        let toc = word(file, 16) as usize;
        let there = usize::from(file[15]);
        let promised = sizes.iter().filter(|size| **size > 0).count();
        if there != promised {
            return Err(format!("{there} streams; a scene of this degree has {promised}"));
        }
        let entries = toc.checked_add(promised * ENTRY).filter(|end| *end <= length);
        let (Some(mut end), true) = (entries, toc >= WHOLE_HEADER) else {
            return Err(format!(
                "the table of contents at byte {toc} is not within the {length} bytes of the file, after the header"
            ));
        };
        let mut streams: [Range<usize>; 6] = Default::default();
        let mut entry = toc;
        for i in 0..sizes.len() {
            if sizes[i] == 0 {
                streams[i] = end..end;
                continue;
            }
            let (compressed, size) = (long(file, entry), long(file, entry + 8));
            entry += ENTRY;
            let name = SECTIONS[i];
            if size != sizes[i] {
                let needed = sizes[i];
                return Err(format!(
                    "the stream of {name} has {size} bytes uncompressed, must have {needed}"
                ));
            }
            let left = length - end;
            if compressed > left as u64 {
                return Err(format!(
                    "truncated: the stream of {name} takes {compressed} bytes, {left} are there"
                ));
            }
            let start = end;
            end += compressed as usize;
            streams[i] = start..end;
        }
        Ok(Layout { toc, streams })
    }
}

/// The little-endian 64 bits at `place`.
fn long(bytes: &[u8], place: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| bytes[place + i]))
}

/// A stream that is to hold `size` bytes: into a buffer that holds no more, so that no stream can fill the memory.
fn decompress(stream: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let mut section = Vec::new();
    if size == 0 {
        return Ok(section);
    }
    if section.try_reserve_exact(size).is_err() {
        return Err(format!("of {size} bytes does not fit in memory"));
    }
    let there = bulk::Decompressor::new()
        .and_then(|mut decompressor| decompressor.decompress_to_buffer(stream, &mut section))
        .map_err(|error| format!("is damaged: {error}"))?;
    if there != size {
        return Err(format!("holds {there} bytes, must hold {size}"));
    }
    Ok(section)
}

impl Container for Streams {
    fn format(&self) -> Format {
        Format::Spz
    }

    fn bytes(&self) -> usize {
        self.file.len() + self.colours.len() + self.harmonics.len()
    }

    fn exact(&self) -> bool {
        false
    }

    fn quantize_colors(&self, _row: usize, coefficients: &mut [f32]) {
        colour::quantize_colors(coefficients);
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        let Layout { toc, streams } = &self.layout;
        let colours = recompress(&self.colours, colour::constants(sh))?;
        let harmonics = recompress(&self.harmonics, colour::harmonics(&self.header, &self.harmonics, sh))?;
        let mut new = streams.clone().map(|stream| &self.file[stream]);
        for (i, changed) in [(COLOURS, &colours), (HARMONICS, &harmonics)] {
            if let Some(changed) = changed {
                new[i] = changed;
            }
        }
        out.write_all(&self.file[..*toc])?;
        for (stream, size) in new.iter().zip(self.header.sections()).filter(|(_, size)| *size > 0) {
            out.write_all(&(stream.len() as u64).to_le_bytes())?;
            out.write_all(&size.to_le_bytes())?;
        }
        for stream in new {
            out.write_all(stream)?;
        }
        out.write_all(&self.file[streams[streams.len() - 1].end..])
    }
}

/// The stream for a section that has changed; one that has not is written as it was read.
fn recompress(old: &[u8], new: Vec<u8>) -> io::Result<Option<Vec<u8>>> {
    if old == new {
        return Ok(None);
    }
    bulk::compress(&new, LEVEL).map(Some)
}
