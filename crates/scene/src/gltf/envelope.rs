//! What a glTF comes in: a JSON text with buffers in it or beside it, or a binary file of chunks.
use super::document::Document;
use super::spans;
use crate::Format;
use std::ops::Range;

/// The first bytes of a binary file.
pub(super) const MAGIC: [u8; 4] = *b"glTF";
/// Bytes before the first chunk.
pub(super) const HEADER: usize = 12;
/// Bytes before the data of a chunk: its length, its type.
pub(super) const CHUNK: usize = 8;
pub(super) const JSON: [u8; 4] = *b"JSON";
pub(super) const BINARY: [u8; 4] = *b"BIN\0";

/// Most bytes of JSON, without buffers that are text in it: what it says takes up to twelve times as many in memory.
const MOST_JSON: usize = 16 << 20;

/// A file, and where its parts are in it.
#[derive(Debug)]
pub(super) struct Envelope {
    pub format: Format,
    pub file: Vec<u8>,
    /// The text of the JSON, with the spaces that fill its chunk.
    text: Range<usize>,
    /// What is in the chunk of the first buffer, with the zeros that fill it.
    pub binary: Option<Range<usize>>,
}

impl Envelope {
    /// Finds the parts of a file; `Err` is the reason why not.
    pub fn open(file: Vec<u8>) -> Result<Envelope, String> {
        let (format, text, binary) = if file.starts_with(&MAGIC) {
            let (text, binary) = chunks(&file)?;
            (Format::Glb, text, binary)
        } else {
            // A byte order mark should not be there, and may be.
            let start = if file.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
            (Format::Gltf, start..file.len(), None)
        };
        if let Err(error) = std::str::from_utf8(&file[text.clone()]) {
            let place = text.start + error.valid_up_to();
            return Err(format!("not a glTF scene: byte {place} of its JSON is not UTF-8"));
        }
        let json = spans::besides_data(&file[text.clone()]);
        if json > MOST_JSON {
            return Err(format!(
                "{json} bytes of JSON besides the buffers in it; the limit is {MOST_JSON}"
            ));
        }
        Ok(Envelope {
            format,
            file,
            text,
            binary,
        })
    }

    /// The JSON.
    pub fn text(&self) -> &str {
        // It was looked at when the file was opened.
        std::str::from_utf8(&self.file[self.text.clone()]).unwrap_or_default()
    }

    /// What the JSON says.
    pub fn document(&self) -> Result<Document<'_>, String> {
        Document::parse(self.text())
    }

    /// What comes before the JSON: nothing but a byte order mark.
    pub fn before_text(&self) -> &[u8] {
        match self.format {
            Format::Gltf => &self.file[..self.text.start],
            _ => &[],
        }
    }

    /// The chunks after the JSON and the first buffer, and whatever follows them.
    pub fn after(&self) -> &[u8] {
        let end = self.binary.as_ref().map_or(self.text.end, |binary| binary.end);
        &self.file[end..]
    }

    /// The length that the header says, which is not that of a file with something behind it.
    pub fn said_length(&self) -> u32 {
        word(&self.file, 8)
    }
}

/// The ranges of the JSON and of the first buffer, if there is one.
fn chunks(file: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>), String> {
    let there = file.len();
    if there < HEADER {
        return Err(format!("truncated: {there} bytes of a header of {HEADER}"));
    }
    let (version, length) = (word(file, 4), word(file, 8) as usize);
    if version != 2 {
        return Err(format!("binary glTF of version {version}; version 2 is read"));
    }
    if length > there {
        return Err(format!(
            "truncated: the header promises {length} bytes, {there} are there"
        ));
    }
    let text = chunk(file, HEADER, length)?.filter(|(kind, _)| *kind == JSON);
    let Some((_, text)) = text else {
        return Err("the first chunk of a binary glTF must be its JSON".into());
    };
    let binary = chunk(file, text.end, length)?.filter(|(kind, _)| *kind == BINARY);
    Ok((text, binary.map(|(_, data)| data)))
}

/// The type of a chunk of a binary glTF, and where its data lies.
type Chunk = ([u8; 4], Range<usize>);

/// The chunk at a byte, if there is one before `end`.
fn chunk(file: &[u8], at: usize, end: usize) -> Result<Option<Chunk>, String> {
    if end.saturating_sub(at) < CHUNK {
        return Ok(None);
    }
    let length = word(file, at) as usize;
    let start = at + CHUNK;
    if length > end - start {
        let left = end - start;
        return Err(format!(
            "truncated: the chunk at byte {at} has {length} bytes, {left} are there"
        ));
    }
    let kind = std::array::from_fn(|i| file[at + 4 + i]);
    Ok(Some((kind, start..start + length)))
}

/// The little-endian 32 bits at `place`.
fn word(bytes: &[u8], place: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[place + i]))
}
