//! What a glTF comes in: a JSON text with buffers in it or beside it, or a binary file of chunks.
use super::document::Document;
use super::spans;
use crate::Format;
use std::ops::Range;

/// The first bytes of a binary file.
pub(super) const MAGIC: [u8; 4] = *b"glTF";
/// What a text may begin with.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
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
            let start = if file.starts_with(BYTE_ORDER_MARK) { 3 } else { 0 };
            (Format::Gltf, start..file.len(), None)
        };
        checked(&file, text.clone())?;
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

/// The JSON of a file, of which what comes after it need not be there; `Err` is the reason why not.
pub(super) fn json(file: &[u8]) -> Result<&str, String> {
    if !file.starts_with(&MAGIC) {
        let start = if file.starts_with(BYTE_ORDER_MARK) { 3 } else { 0 };
        return checked(file, start..file.len());
    }
    version(file)?;
    checked(file, json_chunk(file, file.len())?)
}

/// The JSON in these bytes of a file.
fn checked(file: &[u8], text: Range<usize>) -> Result<&str, String> {
    let start = text.start;
    let text = std::str::from_utf8(&file[text]).map_err(|error| {
        let place = start + error.valid_up_to();
        format!("not a glTF scene: byte {place} of its JSON is not UTF-8")
    })?;
    let json = spans::besides_data(text.as_bytes());
    if json > MOST_JSON {
        return Err(format!(
            "{json} bytes of JSON besides the buffers in it; the limit is {MOST_JSON}"
        ));
    }
    Ok(text)
}

/// Looks at the header of a binary file.
fn version(file: &[u8]) -> Result<(), String> {
    let there = file.len();
    if there < HEADER {
        return Err(format!("truncated: {there} bytes of a header of {HEADER}"));
    }
    match word(file, 4) {
        2 => Ok(()),
        version => Err(format!("binary glTF of version {version}; version 2 is read")),
    }
}

/// Where the JSON of a binary file that ends at `end` is.
fn json_chunk(file: &[u8], end: usize) -> Result<Range<usize>, String> {
    let text = chunk(file, HEADER, end)?.filter(|(kind, _)| *kind == JSON);
    let (_, text) = text.ok_or("the first chunk of a binary glTF must be its JSON")?;
    Ok(text)
}

/// The ranges of the JSON and of the first buffer, if there is one.
fn chunks(file: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>), String> {
    version(file)?;
    let (there, length) = (file.len(), word(file, 8) as usize);
    if length > there {
        return Err(format!(
            "truncated: the header promises {length} bytes, {there} are there"
        ));
    }
    let text = json_chunk(file, length)?;
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
