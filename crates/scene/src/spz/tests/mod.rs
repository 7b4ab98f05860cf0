//! Tests of reading and writing, and the files that they are made of.
mod formula;
mod garbage;
mod others;
mod real;
mod refusals;
mod round_trips;

use crate::summary::tests::agrees;
use crate::{Error, Result, Scene, Sh};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use std::io::{Read, Write};
use std::path::Path;

const VERSIONS: [u32; 3] = [2, 3, 4];
const COLOURS: usize = 2;
const HARMONICS: usize = 5;

/// A file under construction: sections of bytes, so that a test can break one thing.
#[derive(Clone)]
struct File {
    magic: [u8; 4],
    version: u32,
    points: u32,
    degree: u8,
    fractional_bits: u8,
    flags: u8,
    /// Positions, alphas, colours, scales, rotations, spherical harmonics.
    sections: [Vec<u8>; 6],
    /// After the sections of versions 2 and 3, before the table of contents of version 4.
    extensions: Vec<u8>,
    /// After everything.
    after: Vec<u8>,
}

impl File {
    /// Bytes without a pattern in all sections.
    fn new(version: u32, degree: u8, points: u32) -> File {
        let rotation = if version == 2 { 3 } else { 4 };
        let mut state = 1u32;
        let mut byte = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        File {
            magic: *b"NGSP",
            version,
            points,
            degree,
            fractional_bits: 12,
            flags: 1,
            sections: [9, 1, 3, 3, rotation, harmonics(degree)]
                .map(|bytes| (0..bytes * points as usize).map(|_| byte()).collect()),
            extensions: Vec::new(),
            after: Vec::new(),
        }
    }

    /// One Gaussian with these bytes.
    fn one(version: u32, degree: u8, sections: [&[u8]; 6]) -> File {
        File {
            sections: sections.map(<[u8]>::to_vec),
            ..File::new(version, degree, 1)
        }
    }

    /// The header: its last byte is reserved up to version 3, the number of streams in version 4.
    fn header(&self, last: u8) -> Vec<u8> {
        let mut out = self.magic.to_vec();
        out.extend(self.version.to_le_bytes());
        out.extend(self.points.to_le_bytes());
        out.extend([self.degree, self.fractional_bits, self.flags, last]);
        out
    }

    /// What versions 2 and 3 compress.
    fn content(&self) -> Vec<u8> {
        let mut out = self.header(7);
        self.sections.iter().for_each(|section| out.extend(section));
        out.extend(&self.extensions);
        out
    }

    fn bytes(&self) -> Vec<u8> {
        if self.version == 4 {
            self.streams(|_, section| zstd::bulk::compress(section, 1).unwrap(), |_| ())
        } else {
            let mut out = gzip(&self.content());
            out.extend(&self.after);
            out
        }
    }

    /// A file of version 4 with these streams, and a table of contents (compressed and uncompressed sizes) changed.
    fn streams(&self, stream: impl Fn(usize, &[u8]) -> Vec<u8>, change: impl Fn(&mut Vec<[u64; 2]>)) -> Vec<u8> {
        let full = (0..6).filter(|i| !self.sections[*i].is_empty());
        let streams: Vec<_> = full.clone().map(|i| stream(i, &self.sections[i])).collect();
        let sizes = full.zip(&streams);
        let mut sizes = sizes
            .map(|(i, s)| [s.len() as u64, self.sections[i].len() as u64])
            .collect();
        change(&mut sizes);
        let mut out = self.header(streams.len() as u8);
        out.extend((32 + self.extensions.len() as u32).to_le_bytes());
        out.extend(*b"reserved 12.");
        out.extend(&self.extensions);
        out.extend(sizes.iter().flatten().flat_map(|size| size.to_le_bytes()));
        out.extend(streams.concat());
        out.extend(&self.after);
        out
    }

    fn read(&self) -> Result<Scene> {
        read(&self.bytes())
    }

    /// The reason for which the file is refused.
    fn refused(&self) -> String {
        refused(&self.bytes())
    }
}

/// Bytes of the spherical harmonics of a Gaussian.
fn harmonics(degree: u8) -> usize {
    [0, 9, 24, 45, 72][usize::from(degree)]
}

fn gzip(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

/// A file with everything that is compressed uncompressed, for comparison: the gzip stream and what follows it; or
/// header, extensions, streams and what follows them.
fn plain(file: &[u8]) -> Vec<Vec<u8>> {
    if file.starts_with(b"NGSP") {
        let long = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
        let (toc, streams) = (long(16) & 0xffff_ffff, usize::from(file[15]));
        let mut out = vec![file[..toc].to_vec()];
        let mut end = toc + 16 * streams;
        for i in 0..streams {
            let [compressed, size] = [0, 8].map(|offset| long(toc + 16 * i + offset));
            let section = zstd::decode_all(&file[end..end + compressed]).unwrap();
            assert_eq!(section.len(), size);
            out.push(section);
            end += compressed;
        }
        out.push(file[end..].to_vec());
        return out;
    }
    let mut decoder = flate2::bufread::GzDecoder::new(file);
    let mut content = Vec::new();
    decoder.read_to_end(&mut content).unwrap();
    vec![content, decoder.into_inner().to_vec()]
}

fn read(bytes: &[u8]) -> Result<Scene> {
    let scene = Scene::parse(Path::new("test.spz"), bytes)?;
    agrees(bytes, &scene);
    Ok(scene)
}

fn refused(bytes: &[u8]) -> String {
    match read(bytes) {
        Err(Error::BadScene { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut out = Vec::new();
    scene.encode(sh, &mut out).unwrap();
    out
}

#[test]
fn the_helper_reads_gzip_as_any_reader_does() {
    let file = File::new(3, 1, 2);
    let mut content = Vec::new();
    GzDecoder::new(&file.bytes()[..]).read_to_end(&mut content).unwrap();
    assert_eq!(plain(&file.bytes()), [content, Vec::new()]);
}
