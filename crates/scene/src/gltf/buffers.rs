//! The buffers that splats are in: in the file's own chunk, as text within its JSON, or in files beside it.
use super::document::Document;
use super::envelope::Envelope;
use super::spans;
use crate::fields::quote;
use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::ops::Range;
use std::path::{Component, Path};

/// Padding may be there or not.
const LENIENT: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// A buffer.
#[derive(Debug)]
pub(super) struct Buffer {
    pub place: Place,
    /// What is not in the file as it is: the bytes of a text, or of another file.
    own: Vec<u8>,
    /// How many bytes the JSON says.
    pub length: usize,
}

/// Where the bytes of a buffer are.
#[derive(Debug)]
pub(super) enum Place {
    /// The chunk of a binary file.
    Chunk(Range<usize>),
    /// Base64 at this range of the JSON.
    Text { range: Range<usize>, padded: bool },
    /// A file beside, whose name is at this range of the JSON, quotes included.
    Beside { name: String, uri: Range<usize> },
}

/// Where files beside are looked for, and how large all that is read may be.
pub(super) struct Sources<'a> {
    /// `None` where a scene has to be one file.
    pub folder: Option<&'a Path>,
    /// Bytes that there are for them.
    pub memory: u64,
}

impl Buffer {
    /// Loads buffer `index`; `Err` says why not. Memory: what is not in the file.
    pub fn load(
        envelope: &Envelope,
        document: &Document<'_>,
        index: usize,
        sources: &Sources<'_>,
    ) -> Result<Buffer, String> {
        let of = |reason: String| format!("buffer {index}: {reason}");
        let json = &document.buffers[index];
        let (place, own) = match (&json.uri, &envelope.binary) {
            (None, Some(chunk)) if index == 0 => (Place::Chunk(chunk.clone()), Vec::new()),
            (None, _) => return Err(of("no uri, and it is not the chunk of a binary glTF".into())),
            (Some(uri), _) => {
                let text = envelope.text();
                let element = spans::elements(text, "buffers").into_iter().nth(index);
                let range = element.and_then(|element| spans::member(text, element, "uri"));
                let range = range.ok_or_else(|| of("no uri".into()))?;
                match uri.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("data:")) {
                    Some(_) => within(text, range).map_err(of)?,
                    None => beside(uri, range, sources).map_err(of)?,
                }
            }
        };
        let there = match &place {
            Place::Chunk(range) => range.len(),
            _ => own.len(),
        } as u64;
        if there < json.byte_length {
            let length = json.byte_length;
            return Err(of(format!("truncated: byteLength {length}, {there} bytes are there")));
        }
        Ok(Buffer {
            place,
            own,
            length: json.byte_length as usize,
        })
    }

    /// Its bytes, and maybe some that fill a chunk.
    pub fn bytes<'a>(&'a self, envelope: &'a Envelope) -> &'a [u8] {
        match &self.place {
            Place::Chunk(range) => &envelope.file[range.clone()],
            _ => &self.own,
        }
    }

    /// Bytes that it has in memory besides the file.
    pub fn own_bytes(&self) -> usize {
        self.own.len()
    }
}

/// The bytes of the text at `range` of the JSON, a string that begins with `data:`.
fn within(text: &str, range: Range<usize>) -> Result<(Place, Vec<u8>), String> {
    let string = &text[range.start + 1..range.end - 1];
    let comma = string.find(',').filter(|comma| string[..*comma].ends_with(";base64"));
    let Some(comma) = comma else {
        return Err("a data URI that is not base64".into());
    };
    let code = range.start + 2 + comma..range.end - 1;
    // A text with escapes is refused as one with any other character that base64 has not.
    let code_text = &text[code.clone()];
    let own = LENIENT
        .decode(code_text)
        .map_err(|error| format!("its data URI is no base64: {error}"))?;
    let padded = code_text.len().is_multiple_of(4);
    Ok((Place::Text { range: code, padded }, own))
}

/// The base64 of bytes.
pub(super) fn encode(bytes: &[u8], padded: bool) -> String {
    match padded {
        true => base64::engine::general_purpose::STANDARD.encode(bytes),
        false => base64::engine::general_purpose::STANDARD_NO_PAD.encode(bytes),
    }
}

/// The bytes of the file beside that `uri` names, if there may be one. No name leads out of the folder.
fn beside(uri: &str, range: Range<usize>, sources: &Sources<'_>) -> Result<(Place, Vec<u8>), String> {
    let shown = quote(uri);
    let Some(folder) = sources.folder else {
        return Err(format!(
            "in another file, {shown:?}, and a scene has to be one here: pack it as .glb"
        ));
    };
    let name = percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| format!("uri {shown:?} is not UTF-8"))?;
    let path = Path::new(name.as_ref());
    let stays = path
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if name.is_empty() || name.contains([':', '\\', '\0']) || !stays {
        return Err(format!(
            "uri {shown:?} must name a file in the folder of the scene, or below it"
        ));
    }
    let path = folder.join(path);
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    let metadata = std::fs::metadata(&path).map_err(failed)?;
    if !metadata.is_file() {
        return Err(format!("{}: not a regular file", path.display()));
    }
    if metadata.len() > sources.memory {
        let (size, memory) = (metadata.len(), sources.memory);
        return Err(format!("{}: {size} bytes, there are {memory} for it", path.display()));
    }
    let own = std::fs::read(&path).map_err(failed)?;
    let name = name.into_owned();
    Ok((Place::Beside { name, uri: range }, own))
}
