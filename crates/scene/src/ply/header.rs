//! The header of a PLY file, bounded and checked before anything is allocated for the body.
//!
//! At most [`MAX_HEADER`] bytes are read in search of `end_header`; `ply-rs` parses them. Counts are believed only
//! after they were compared with the size of the file, see the readers of the body.
use crate::fields::{bytes, quote};
use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{DefaultElement, ElementDef, Encoding, Header, PropertyType, ScalarType};
use std::io::{BufRead, Read};

/// Longest header, bytes. A scene of degree 4 with all usual properties needs under 3,000.
pub(crate) const MAX_HEADER: u64 = 64 * 1024;

/// How the rows of the body are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Storage {
    /// Lines of numbers.
    Ascii,
    /// Rows of fixed size.
    Binary {
        /// Most significant byte first.
        big_endian: bool,
    },
}

/// Reads up to and including the line `end_header`, from a source at its first byte.
///
/// Returns the bytes as they are. An `Err` holds the reason; failures of the source are its `io::Error`.
pub(crate) fn read_header(source: &mut impl BufRead) -> std::io::Result<Result<Vec<u8>, String>> {
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
pub(crate) fn parse(header: &[u8]) -> Result<Header, String> {
    // Comments in other encodings than UTF-8 exist; they are kept as bytes and only parsed lossily.
    let text = String::from_utf8_lossy(header);
    check_counts(&text)?;
    let parsed = Parser::<DefaultElement>::new()
        .read_header(&mut Reader::new(text.as_bytes()))
        .map_err(|e| format!("bad header: {}", quote(&e.to_string())))?;
    check_duplicates(&text, &parsed)?;
    Ok(parsed)
}

/// How the rows of a body are stored.
pub(crate) fn storage(header: &Header) -> Storage {
    match header.encoding {
        Encoding::Ascii => Storage::Ascii,
        Encoding::BinaryLittleEndian => Storage::Binary { big_endian: false },
        Encoding::BinaryBigEndian => Storage::Binary { big_endian: true },
    }
}

/// An element, and how many bytes (binary) or lines (ASCII) of the body are before its first row; `Err` says why it
/// cannot be found.
pub(crate) fn element<'a>(header: &'a Header, name: &str) -> Result<(&'a ElementDef, u64), String> {
    let Some(position) = header.elements.get_index_of(name) else {
        return Err(format!("the header has no element {name}"));
    };
    let mut before = 0u64;
    for element in header.elements.values().take(position) {
        before = size(element, storage(header))
            .and_then(|more| before.checked_add(more))
            .ok_or_else(|| {
                format!(
                    "element {} before {name} has a list, no properties or too many rows; it cannot be skipped",
                    quote(&element.name)
                )
            })?;
    }
    Ok((&header.elements[position], before))
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

/// Bytes or lines that an element takes, if that can be told from the header.
fn size(element: &ElementDef, storage: Storage) -> Option<u64> {
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
pub(crate) fn scalars(element: &ElementDef) -> Result<Vec<(&str, &ScalarType)>, String> {
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
