//! Streams of other lengths in a buffer: what follows moves, and the JSON says where to.
use super::envelope::Envelope;
use super::spans;
use std::io;
use std::ops::Range;

/// What follows a stream stays on multiples of so many bytes on which it was: all numbers of glTF do, and its extensions'.
const ALIGNMENT: usize = 8;

/// A stream in place of an older one.
pub(super) struct Splice {
    pub view: usize,
    /// Bytes of the older one in the buffer.
    pub range: Range<usize>,
    pub bytes: Vec<u8>,
}

impl Splice {
    /// Bytes of zeros after the stream.
    fn fill(&self) -> usize {
        // So that lengths differ by a multiple of the alignment.
        let (new, old) = (self.bytes.len(), self.range.len());
        (old + ALIGNMENT - new % ALIGNMENT) % ALIGNMENT
    }

    /// The first byte after the stream, once it and all before it are replaced, where it was before.
    fn moves(&self, by: isize) -> isize {
        by + (self.bytes.len() + self.fill()) as isize - self.range.len() as isize
    }
}

/// Makes a buffer of the one that was read.
type Rebuild<'s> = Box<dyn Fn(&[u8]) -> Vec<u8> + 's>;

/// How a buffer of `length` bytes is made with `splices` in it, in their order, and its new length; adds to `edits` what
/// the JSON has to say.
pub(super) fn moved<'s>(
    envelope: &Envelope,
    buffer: usize,
    length: usize,
    splices: &'s [Splice],
    edits: &mut Vec<(Range<usize>, String)>,
) -> io::Result<(Rebuild<'s>, usize)> {
    let text = envelope.text();
    let document = envelope.document().map_err(io::Error::other)?;
    let views = spans::elements(text, "bufferViews");
    let shift = |offset: usize| {
        let before = splices.iter().take_while(|splice| splice.range.end <= offset);
        before.fold(0, |by, splice| splice.moves(by))
    };
    let mut say = |object: Option<Range<usize>>, key: &str, old: u64, new: u64| {
        let place = object.and_then(|object| spans::member(text, object, key));
        match place {
            Some(place) if old != new => edits.push((place, new.to_string())),
            None if old != new => return Err(io::Error::other(format!("no {key} to change"))),
            _ => (),
        }
        Ok(())
    };
    for (i, view) in document
        .buffer_views
        .iter()
        .enumerate()
        .filter(|(_, view)| view.buffer == buffer)
    {
        let offset = view.byte_offset;
        let place = usize::try_from(offset).unwrap_or(usize::MAX);
        let new = offset.saturating_add_signed(shift(place) as i64);
        say(views.get(i).cloned(), "byteOffset", offset, new)?;
        if let Some(splice) = splices.iter().find(|splice| splice.view == i) {
            say(
                views.get(i).cloned(),
                "byteLength",
                view.byte_length,
                splice.bytes.len() as u64,
            )?;
        }
    }
    let new_length = length.saturating_add_signed(shift(length));
    let buffers = spans::elements(text, "buffers");
    say(
        buffers.get(buffer).cloned(),
        "byteLength",
        length as u64,
        new_length as u64,
    )?;
    let make = move |old: &[u8]| {
        let mut new = Vec::with_capacity(new_length);
        let mut at = 0;
        for splice in splices {
            new.extend_from_slice(&old[at..splice.range.start]);
            new.extend_from_slice(&splice.bytes);
            new.extend(std::iter::repeat_n(0, splice.fill()));
            at = splice.range.end;
        }
        new.extend_from_slice(&old[at..]);
        new
    };
    Ok((Box::new(make), new_length))
}
