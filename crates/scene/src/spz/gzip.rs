//! Versions 2 and 3: header, sections and extensions in one gzip stream.
use super::header::{COLOURS, HARMONICS, HEADER, Header};
use super::{attributes, colour, limits};
use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::{Error, Result};
use flate2::Compression;
use flate2::bufread::GzDecoder;
use flate2::write::GzEncoder;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// The first bytes of every gzip stream.
pub(super) const MAGIC: [u8; 2] = [0x1f, 0x8b];
const VERSIONS: [u32; 2] = [2, 3];

/// A file as it was read.
#[derive(Debug)]
struct Gzip {
    header: Header,
    /// What was compressed: header, sections, and whatever follows them.
    content: Vec<u8>,
    /// What the file has after the gzip stream; readers ignore it.
    after: Vec<u8>,
}

/// Reads a file of `size` bytes.
pub(super) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let mut decoder = GzDecoder::new(source.take(size));
    let (header, content) = inflate(&mut decoder, size).map_err(|failure| match failure {
        Failure::Bad(reason) => bad(path, reason),
        Failure::Io(error) => Error::io(path)(error),
    })?;
    let mut after = Vec::new();
    let mut rest = decoder.into_inner();
    rest.read_to_end(&mut after).map_err(Error::io(path))?;
    let gaussians = attributes::decode(&header, sections(&header, &content));
    Ok((gaussians, Arc::new(Gzip { header, content, after })))
}

enum Failure {
    Bad(String),
    Io(io::Error),
}

impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Failure::Bad(reason)
    }
}

impl From<io::Error> for Failure {
    /// The decoder says by these kinds what is wrong with the bytes; others come from the source.
    fn from(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::UnexpectedEof => Failure::Bad("truncated: the gzip stream has no end".to_string()),
            ErrorKind::InvalidInput | ErrorKind::InvalidData => Failure::Bad(format!("damaged gzip stream: {error}")),
            _ => Failure::Io(error),
        }
    }
}

/// The header at the start of a stream that is a file of `size` bytes, and the bytes that are kept of it uncompressed,
/// at least; `Err` is the reason for which there is none.
pub(super) fn header(head: &[u8], size: u64) -> Result<(Header, u64), String> {
    match begin(&mut GzDecoder::new(head), size) {
        Ok((header, content, promised)) => Ok((header, content.len() as u64 + promised)),
        Err(Failure::Bad(reason)) => Err(reason),
        Err(Failure::Io(error)) => Err(error.to_string()),
    }
}

/// The header, its bytes, and the number of those that it promises after it, if the `size` of the file allows so many.
fn begin(decoder: &mut GzDecoder<impl BufRead>, size: u64) -> Result<(Header, Vec<u8>, u64), Failure> {
    let mut content = Vec::new();
    decoder.take(HEADER as u64).read_to_end(&mut content)?;
    let Some(start) = content.first_chunk() else {
        let there = content.len();
        return Err(format!("not an SPZ scene: the gzip stream holds {there} bytes, fewer than a header").into());
    };
    let header = Header::parse(start, &VERSIONS, "a gzip stream")?;
    let promised = header.sections().iter().sum();
    limits::check(promised, size)?;
    Ok((header, content, promised))
}

/// Everything that was compressed, of which no more is taken than the header and the `size` of the file allow.
fn inflate(decoder: &mut GzDecoder<impl BufRead>, size: u64) -> Result<(Header, Vec<u8>), Failure> {
    let (header, mut content, promised) = begin(decoder, size)?;
    usize::try_from(promised)
        .ok()
        .and_then(|promised| content.try_reserve_exact(promised).ok())
        .ok_or_else(|| format!("{promised} bytes of Gaussians do not fit in memory"))?;
    decoder.take(promised).read_to_end(&mut content)?;
    let there = (content.len() - HEADER) as u64;
    if there < promised {
        let points = header.points;
        return Err(format!(
            "truncated: the {points} Gaussians that the header promises take {promised} bytes, {there} are there"
        )
        .into());
    }
    // To the end also where nothing follows: that is where the checksum is.
    decoder.take(limits::MOST_AFTER + 1).read_to_end(&mut content)?;
    if content.len() as u64 - HEADER as u64 - promised > limits::MOST_AFTER {
        let most = limits::MOST_AFTER;
        return Err(format!("more than {most} bytes follow the Gaussians; that is the limit").into());
    }
    Ok((header, content))
}

fn sections<'a>(header: &Header, content: &'a [u8]) -> [&'a [u8]; 6] {
    header.cut(&content[HEADER..])
}

impl Container for Gzip {
    fn format(&self) -> Format {
        Format::Spz
    }

    fn bytes(&self) -> usize {
        self.content.len() + self.after.len()
    }

    fn exact(&self) -> bool {
        false
    }

    fn quantize_colors(&self, _row: usize, coefficients: &mut [f32]) {
        colour::quantize_colors(coefficients);
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        let old = sections(&self.header, &self.content);
        let colours = colour::constants(sh);
        let harmonics = colour::harmonics(&self.header, old[HARMONICS], sh);
        let mut new = old;
        new[COLOURS] = &colours;
        new[HARMONICS] = &harmonics;
        // Without a name and a time in it, and on the level that the reference implementation uses.
        let mut encoder = GzEncoder::new(&mut *out, Compression::default());
        encoder.write_all(&self.content[..HEADER])?;
        for section in new {
            encoder.write_all(section)?;
        }
        let end = HEADER + new.iter().map(|section| section.len()).sum::<usize>();
        encoder.write_all(&self.content[end..])?;
        encoder.finish()?;
        out.write_all(&self.after)
    }
}
