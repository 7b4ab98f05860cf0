//! Files of mkkellogg's viewer GaussianSplats3D (.ksplat), of version 0.1 and all three levels of compression.
//!
//! Sections of rows: position, standard deviations, rotation w, x, y, z; colour and opacity as four bytes; harmonics up to
//! degree 2. Level 0 has single precision; level 1 half precision, and positions as steps from the centre of a bucket;
//! level 2 also bytes for harmonics, between two numbers of the header.
//!
//! **What is kept.** Every byte but those of red, green, blue and harmonics: headers, buckets, what follows the sections.
//!
//! Files have no magic number. One is known by its version, 0.1, and by numbers of sections and Gaussians that can be.
mod colour;
mod half;
mod header;
mod rows;

pub(crate) use colour::index;
pub(crate) use header::{HEADER, Level, MAX_DEGREE, SECTION};

use crate::Result;
use crate::container::{Container, Format};
use crate::error::bad;
use crate::fields::rest_count;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::range::Range;
use crate::remaining::read_remaining;
use crate::summary::Summary;
use colour::Harmonics;
use header::{Header, Section};
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// A file as it was read.
#[derive(Debug)]
struct Ksplat {
    file: Vec<u8>,
    header: Header,
    sections: Vec<Section>,
    ignored: Ignored,
}

/// Whether a file with these first bytes is to be read as one, be it only to say what is wrong with it.
pub(crate) fn detect(first: &[u8]) -> bool {
    header::detect(first)
}

/// Reads a file of `size` bytes from its first, for which [`detect`] holds; `path` is for messages.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
    bad_rows: BadRows,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let file = read_remaining(path, source, size)?;
    let (gaussians, ksplat) = parse(file, bad_rows).map_err(|reason| bad(path, format!("a .ksplat: {reason}")))?;
    Ok((gaussians, Arc::new(ksplat)))
}

fn parse(file: Vec<u8>, bad_rows: BadRows) -> Result<(Gaussians, Ksplat), String> {
    let size = file.len() as u64;
    let header = header::header(&file, size)?;
    let sections = header::sections(&file, &header, size)?;
    let (gaussians, ignored) = rows::read(&file, &header, &sections, bad_rows)?;
    let ksplat = Ksplat {
        file,
        header,
        sections,
        ignored,
    };
    Ok((gaussians, ksplat))
}

/// What the head of a file of `size` bytes says, for which [`detect`] holds; `Err` is the reason for which it is none.
/// Sections whose headers are not in the head may have any degree.
pub(crate) fn summary(head: &[u8], size: u64) -> Result<Summary, String> {
    let said = || -> Result<Summary, String> {
        let header = header::header(head, size)?;
        let sections = header::sections(head, &header, size)?;
        let degrees = sections.iter().map(|section| section.degree);
        let degree = match sections.len() == header.sections {
            true => degrees.max().unwrap_or(0),
            false => header::MAX_DEGREE,
        };
        Ok(Summary {
            format: Format::Ksplat,
            gaussians: header.gaussians,
            degree: degree as u64,
            file: size,
        })
    };
    said().map_err(|reason| format!("a .ksplat: {reason}"))
}

impl Ksplat {
    /// The section of row `row` of the file.
    fn section(&self, row: usize) -> &Section {
        let after = self.sections.partition_point(|section| section.first <= row as u64);
        &self.sections[after - 1]
    }
}

impl Container for Ksplat {
    fn format(&self) -> Format {
        Format::Ksplat
    }

    fn bytes(&self) -> usize {
        self.file.len()
    }

    fn exact(&self) -> bool {
        false
    }

    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        let there = rest_count(self.section(self.ignored.file_row(row)).degree);
        let harmonics = Harmonics::of(&self.header);
        let (constants, rest) = coefficients.split_at_mut(3);
        for value in constants {
            *value = Range::UNIT.coefficient(Range::UNIT.nearest(*value));
        }
        for (i, value) in rest.iter_mut().enumerate() {
            // Sections of lower degrees have no room for what others have.
            *value = if i < there { harmonics.kept(*value) } else { 0.0 };
        }
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.ignored.if_any()
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        let (level, harmonics) = (self.header.level, Harmonics::of(&self.header));
        let mut colours = self.ignored.spread(sh);
        let mut written = 0;
        for section in &self.sections {
            let (start, end) = (section.rows as usize, section.end as usize);
            out.write_all(&self.file[written..start])?;
            let each = level.row(section.degree);
            let mut patched = vec![0; each];
            for row in self.file[start..end].chunks_exact(each) {
                patched.copy_from_slice(row);
                if let Some(colour) = colours.next().flatten() {
                    let bytes = &mut patched[level.geometry()..];
                    colour::write_constants(bytes, colour);
                    let there = rest_count(section.degree);
                    for (i, value) in colour[3..].iter().take(there).enumerate() {
                        harmonics.write(&mut bytes[4..], colour::index(i), *value);
                    }
                }
                out.write_all(&patched)?;
            }
            written = end;
        }
        out.write_all(&self.file[written..])
    }
}

#[cfg(test)]
mod tests;
