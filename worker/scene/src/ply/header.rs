//! The header of a PLY file, bounded and checked before anything is allocated for the body.
//!
//! At most [`MAX_HEADER`] bytes are read in search of `end_header`; `ply-rs` parses them. Counts are believed only
//! after they were compared with the size of the file, see the readers of the body.
use super::fields::Fields;
use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{DefaultElement, ElementDef, Encoding, Header, PropertyType, ScalarType};
use std::io::{BufRead, Read};

/// Longest header, bytes. A scene of degree 4 with all usual properties needs under 3,000.
const MAX_HEADER: u64 = 64 * 1024;
/// Most characters of somebody else's message or line that are repeated in ours.
const MAX_QUOTE: usize = 200;

/// How the rows of the body are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    /// Lines of numbers.
    Ascii,
    /// Rows of fixed size.
    Binary {
        /// Most significant byte first.
        big_endian: bool,
    },
}

/// What the header says of the file.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// How rows are stored.
    pub storage: Storage,
    /// Bytes (binary) or lines (ASCII) of the body before the first Gaussian.
    pub skip: u64,
    /// Gaussians that the header promises.
    pub rows: u64,
    /// Bytes of a binary row.
    pub row_bytes: usize,
    /// Properties of a row.
    pub columns: usize,
    /// Which of them are used, and where they are.
    pub fields: Fields,
}

impl Layout {
    /// Compares the counts with the bytes after the header, before anything is allocated; `Err` is the reason.
    pub fn check_size(&self, body: u64) -> Result<(), String> {
        // The shortest row of text has a digit a value and a separator after each but the very last.
        let (row, slack) = match self.storage {
            Storage::Binary { .. } => (self.row_bytes as u64, 0),
            Storage::Ascii => (2 * self.columns as u64, 1),
        };
        let skip = if self.storage == Storage::Ascii { 0 } else { self.skip };
        let there = (body + slack).saturating_sub(skip) / row;
        if there < self.rows || body < skip {
            let rows = self.rows;
            return Err(match self.storage {
                Storage::Binary { .. } => truncated(there, rows),
                Storage::Ascii => {
                    format!("truncated body: {body} bytes cannot hold the {rows} Gaussians that the header promises")
                }
            });
        }
        Ok(())
    }
}

/// The complaint about missing rows.
pub(super) fn truncated(there: u64, promised: u64) -> String {
    format!("truncated body: {there} of the {promised} Gaussians that the header promises are there")
}

/// Reads up to and including the line `end_header`, from a source at its first byte.
///
/// Returns the bytes as they are. An `Err` holds the reason; failures of the source are its `io::Error`.
pub(super) fn read_header(source: &mut impl BufRead) -> std::io::Result<Result<Vec<u8>, String>> {
    let mut header = Vec::new();
    let mut bounded = source.take(MAX_HEADER);
    loop {
        let start = header.len();
        if bounded.read_until(b'\n', &mut header)? == 0 {
            let reason = if header.len() as u64 == MAX_HEADER {
                format!("no end_header in the first {MAX_HEADER} bytes")
            } else {
                "the file ends before end_header".to_string()
            };
            return Ok(Err(reason));
        }
        let line = header[start..].trim_ascii_end();
        if start == 0 && line != b"ply" {
            return Ok(Err("not a PLY file: its first line is not \"ply\"".to_string()));
        }
        if line == b"end_header" {
            return Ok(Ok(header));
        }
    }
}

/// Understands a header; `Err` is the reason why not.
pub(super) fn parse(header: &[u8]) -> Result<Layout, String> {
    // Comments in other encodings than UTF-8 exist; they are kept as bytes and only parsed lossily.
    let text = String::from_utf8_lossy(header);
    check_counts(&text)?;
    let parsed = Parser::<DefaultElement>::new()
        .read_header(&mut Reader::new(text.as_bytes()))
        .map_err(|e| format!("bad header: {}", quote(&e.to_string())))?;
    check_duplicates(&text, &parsed)?;
    let Some(position) = parsed.elements.get_index_of("vertex") else {
        return Err("the header has no element vertex".to_string());
    };
    let storage = match parsed.encoding {
        Encoding::Ascii => Storage::Ascii,
        Encoding::BinaryLittleEndian => Storage::Binary { big_endian: false },
        Encoding::BinaryBigEndian => Storage::Binary { big_endian: true },
    };
    let mut skip = 0u64;
    for element in parsed.elements.values().take(position) {
        skip = skipped(element, storage)
            .and_then(|more| skip.checked_add(more))
            .ok_or_else(|| {
                format!(
                    "element {} before vertex has a list, no properties or too many rows; it cannot be skipped",
                    quote(&element.name)
                )
            })?;
    }
    let vertex = &parsed.elements[position];
    let columns = scalars(vertex)?;
    let fields = Fields::find(&columns)?;
    Ok(Layout {
        storage,
        skip,
        rows: vertex.count as u64,
        row_bytes: columns.iter().map(|(_, t)| bytes(t)).sum(),
        columns: columns.len(),
        fields,
    })
}

/// Counts that no integer holds get a message that says so.
fn check_counts(text: &str) -> Result<(), String> {
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        if words.next() == Some("element")
            && let (Some(name), Some(count)) = (words.next(), words.next())
            && count.bytes().all(|b| b.is_ascii_digit())
            && count.parse::<usize>().is_err()
        {
            let (name, count) = (quote(name), quote(count));
            return Err(format!(
                "element {name}: a count of {count} is beyond the limit of {}",
                usize::MAX
            ));
        }
    }
    Ok(())
}

/// `ply-rs` keeps the last of two elements or properties of one name, which would shift every later column.
fn check_duplicates(text: &str, parsed: &Header) -> Result<(), String> {
    let lines = |word: &str| {
        text.lines()
            .filter(|line| line.split_ascii_whitespace().next() == Some(word))
            .count()
    };
    if lines("element") != parsed.elements.len() {
        return Err("the header has two elements of the same name".to_string());
    }
    let properties: usize = parsed.elements.values().map(|e| e.properties.len()).sum();
    if lines("property") != properties {
        return Err("an element of the header has two properties of the same name".to_string());
    }
    Ok(())
}

/// Bytes or lines that an element before the vertices takes, if that can be told from the header.
fn skipped(element: &ElementDef, storage: Storage) -> Option<u64> {
    if element.properties.is_empty() && element.count > 0 {
        return None;
    }
    match storage {
        Storage::Ascii => Some(element.count as u64),
        Storage::Binary { .. } => {
            let row: usize = scalars(element).ok()?.iter().map(|(_, t)| bytes(t)).sum();
            (element.count as u64).checked_mul(row as u64)
        }
    }
}

/// The properties of an element, all of which must be scalars.
fn scalars(element: &ElementDef) -> Result<Vec<(&str, &ScalarType)>, String> {
    element
        .properties
        .values()
        .map(|property| match &property.data_type {
            PropertyType::Scalar(kind) => Ok((property.name.as_str(), kind)),
            PropertyType::List(..) => {
                let (name, element) = (quote(&property.name), quote(&element.name));
                Err(format!("property {name} of element {element} is a list"))
            }
        })
        .collect()
}

/// Bytes of a scalar in a binary row.
pub(super) fn bytes(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Somebody else's text on one line and not too long.
pub(super) fn quote(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_QUOTE) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}
