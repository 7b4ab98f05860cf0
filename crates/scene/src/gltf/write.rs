//! A file with other colours: bytes of buffers in their places, and of the JSON no more than what has to be said anew.
use super::File;
use super::buffers::{Place, encode};
use super::envelope::{BINARY, JSON, MAGIC};
use super::part::Colours;
use super::splice::{Splice, moved};
use crate::Result;
use crate::atomic_write::{Pending, write_whole};
use crate::container::Format;
use crate::error::{Error, bad};
use crate::gaussians::Sh;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

/// Buffers that are not as they were, and what the JSON says of them.
pub(super) struct Changed {
    buffers: BTreeMap<usize, Vec<u8>>,
    /// Ranges of the JSON, and what is there instead.
    edits: Vec<(Range<usize>, String)>,
}

impl File {
    /// What is not as it was with the colours `sh`.
    pub(super) fn changed(&self, sh: &Sh) -> io::Result<Changed> {
        let mut buffers: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
        // Of every stream the new colours, in the space of its node.
        let mut streams: BTreeMap<usize, Sh> = BTreeMap::new();
        for (file_row, colour) in self.ignored.spread(sh).enumerate() {
            let (Some(colour), Some(index)) = (colour, self.part(file_row)) else {
                continue;
            };
            let part = &self.parts[index];
            let row = file_row - part.first;
            let node = part.to_node(|buffer| self.buffer(buffer), row, colour);
            match &part.colours {
                Colours::Attributes(splats) => {
                    for (elements, values) in splats.harmonics.iter().zip(node.chunks_exact(3)) {
                        let old = self.buffer(elements.buffer);
                        let place = elements.at(row);
                        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
                        let range = place..place + bytes.len();
                        if old[range.clone()] != bytes {
                            let new = buffers.entry(elements.buffer).or_insert_with(|| old.to_vec());
                            new[range].copy_from_slice(&bytes);
                        }
                    }
                }
                Colours::Spz(_) => {
                    let degree = (node.len() / 3).isqrt() - 1;
                    let new = streams.entry(index).or_insert_with(|| Sh {
                        degree,
                        coefficients: Vec::with_capacity(part.count * node.len()),
                    });
                    new.coefficients.extend(node);
                }
            }
        }
        let mut edits = Vec::new();
        self.splice(streams, &mut buffers, &mut edits)?;
        Ok(Changed { buffers, edits })
    }

    /// Puts streams that are not as they were into their buffers.
    fn splice(
        &self,
        mut streams: BTreeMap<usize, Sh>,
        buffers: &mut BTreeMap<usize, Vec<u8>>,
        edits: &mut Vec<(Range<usize>, String)>,
    ) -> io::Result<()> {
        let mut splices: BTreeMap<usize, Vec<Splice>> = BTreeMap::new();
        for (index, part) in self.parts.iter().enumerate() {
            let Colours::Spz(stream) = &part.colours else { continue };
            let Some(sh) = streams.remove(&index) else { continue };
            if stream.is(&sh) {
                continue;
            }
            let mut bytes = Vec::new();
            stream.file.write(&sh, &mut bytes)?;
            splices.entry(stream.buffer).or_default().push(Splice {
                view: stream.view,
                range: stream.range.clone(),
                bytes,
            });
        }
        for (index, mut all) in splices {
            all.sort_by_key(|splice| splice.range.start);
            let old = buffers.remove(&index).unwrap_or_else(|| self.buffer(index).to_vec());
            let length = self.buffers.get(&index).map_or(old.len(), |buffer| buffer.length);
            let (new, new_length) = moved(&self.envelope, index, length, &all, edits)?;
            let mut bytes = new(&old[..length]);
            if new_length == length {
                bytes.extend_from_slice(&old[length..]);
            }
            buffers.insert(index, bytes);
        }
        Ok(())
    }

    /// Writes the file itself; `names` are those of buffers in other files, by the buffer.
    pub(super) fn write_main(
        &self,
        mut changed: Changed,
        names: &BTreeMap<usize, String>,
        out: &mut dyn Write,
    ) -> io::Result<()> {
        let envelope = &self.envelope;
        let mut chunk = None;
        for (index, buffer) in &self.buffers {
            match &buffer.place {
                Place::Chunk(range) => {
                    let old = &envelope.file[range.clone()];
                    chunk = Some(changed.buffers.get(index).map_or(old, Vec::as_slice));
                }
                Place::Text { range, padded } => {
                    if let Some(bytes) = changed.buffers.get(index) {
                        changed.edits.push((range.clone(), encode(bytes, *padded)));
                    }
                }
                Place::Beside { uri, .. } => {
                    let name = names.get(index).map(|name| serde_json::to_string(&escaped(name)));
                    if let Some(name) = name.transpose()? {
                        changed.edits.push((uri.clone(), name));
                    }
                }
            }
        }
        let chunk = chunk.or_else(|| envelope.binary.clone().map(|range| &envelope.file[range]));
        let text = edited(envelope.text(), changed.edits);
        match envelope.format {
            Format::Glb => self.write_chunks(&text, chunk, out),
            _ => {
                out.write_all(envelope.before_text())?;
                out.write_all(text.as_bytes())
            }
        }
    }

    /// Writes a binary file.
    fn write_chunks(&self, text: &str, chunk: Option<&[u8]>, out: &mut dyn Write) -> io::Result<()> {
        let old = &self.envelope;
        // A chunk that is as long as it was is filled as it was; others to whole words.
        let mut text = text.to_string();
        if text.len() != old.text().len() {
            text.truncate(text.trim_end().len());
            text += &" ".repeat(text.len().next_multiple_of(4) - text.len());
        }
        let there = old.binary.as_ref().map_or(0, Range::len);
        let fill = chunk.map_or(0, |chunk| {
            if chunk.len() == there {
                0
            } else {
                chunk.len().next_multiple_of(4) - chunk.len()
            }
        });
        let chunk_length = chunk.map_or(0, |chunk| chunk.len() + fill);
        let grown = (text.len() + chunk_length) as i128 - (old.text().len() + there) as i128;
        let word = |length: i128| {
            u32::try_from(length)
                .map_err(|_| io::Error::other(format!("{length} bytes; the limit of .glb is {}", u32::MAX)))
        };
        out.write_all(&MAGIC)?;
        out.write_all(&2u32.to_le_bytes())?;
        out.write_all(&word(i128::from(old.said_length()) + grown)?.to_le_bytes())?;
        out.write_all(&word(text.len() as i128)?.to_le_bytes())?;
        out.write_all(&JSON)?;
        out.write_all(text.as_bytes())?;
        if let Some(chunk) = chunk {
            out.write_all(&word(chunk_length as i128)?.to_le_bytes())?;
            out.write_all(&BINARY)?;
            out.write_all(chunk)?;
            out.write_all(&[0; 3][..fill])?;
        }
        out.write_all(old.after())
    }

    /// Writes the file and those beside it, each whole or not at all and the one that names them last.
    pub(super) fn write_files(&self, sh: &Sh, path: &Path) -> Result<()> {
        let changed = self.changed(sh).map_err(Error::io(path))?;
        let names = self.names(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut beside = Vec::new();
        for (index, name) in &names {
            let bytes = changed.buffers.get(index).map_or(self.buffer(*index), Vec::as_slice);
            beside.push(Pending::write(&folder.join(name), |out| out.write_all(bytes))?);
        }
        if beside.is_empty() {
            return write_whole(path, |out| self.write_main(changed, &names, out));
        }
        let main = Pending::write(path, |out| self.write_main(changed, &names, out))?;
        beside.into_iter().try_for_each(Pending::finish)?;
        main.finish()
    }

    /// Names of the files beside one at `path`, after its own, and none that a buffer has already.
    fn names(&self, path: &Path) -> Result<BTreeMap<usize, String>> {
        let beside = self.buffers.iter().filter_map(|(index, buffer)| match &buffer.place {
            Place::Beside { name, .. } => Some((*index, name.as_str())),
            _ => None,
        });
        let beside: Vec<(usize, &str)> = beside.collect();
        if beside.is_empty() {
            return Ok(BTreeMap::new());
        }
        let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else {
            return Err(bad(
                path,
                "a name that is not UTF-8; files beside are named after it".into(),
            ));
        };
        let candidates = std::iter::once(format!("{stem}.bin")).chain((2..).map(|i| format!("{stem}-{i}.bin")));
        let taken = |candidate: &String| beside.iter().any(|(_, name)| name.eq_ignore_ascii_case(candidate));
        let free = candidates.filter(|candidate| !taken(candidate));
        Ok(beside.iter().map(|(index, _)| *index).zip(free).collect())
    }
}

/// A file's name as a URI.
fn escaped(name: &str) -> String {
    use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
    const PLAIN: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'.').remove(b'~');
    utf8_percent_encode(name, PLAIN).to_string()
}

/// The text with other words at ranges that do not overlap.
fn edited(text: &str, mut edits: Vec<(Range<usize>, String)>) -> String {
    edits.sort_by_key(|(range, _)| range.start);
    let mut new = String::with_capacity(text.len());
    let mut at = 0;
    for (range, word) in edits {
        new += &text[at..range.start];
        new += &word;
        at = range.end;
    }
    new + &text[at..]
}
