//! Bytes that more than one attribute is made of: none of them may be a colour, since changing one would change others.
use super::accessor::Elements;
use super::document::Document;
use super::part::{Colours, Part};
use super::read::written;

/// Whether the coefficients that are written, those up to `degree`, are apart from each other and from the geometry of
/// all splats, and streams from all other buffer views; `Err` says what shares bytes.
pub(super) fn check(document: &Document<'_>, parts: &[Part], degree: usize) -> Result<(), String> {
    let (mut colours, mut geometry) = (Vec::new(), Vec::new());
    for part in parts {
        if let Colours::Attributes(splats) = &part.colours {
            colours.extend(written(splats, degree).copied());
            geometry.extend(splats.geometry().map(|elements| *elements));
        }
    }
    let shared = "spherical harmonics share bytes with other attributes of splats, and could not be changed alone";
    colours.sort_by_key(|elements| (elements.buffer, elements.start));
    for (i, one) in colours.iter().enumerate() {
        // Those that begin before this one ends; interleaved ones are a few dozen at most.
        let near = colours[i + 1..].iter().take_while(|other| begins_within(other, one));
        if near.into_iter().any(|other| !one.is_apart_from(other)) {
            return Err(shared.into());
        }
    }
    for one in &geometry {
        let overlaps = |colour: &&Elements| colour.buffer == one.buffer;
        if colours.iter().filter(overlaps).any(|colour| !one.is_apart_from(colour)) {
            return Err(shared.into());
        }
    }
    let mut views = Vec::new();
    for part in parts {
        let Colours::Spz(stream) = &part.colours else { continue };
        if views.contains(&stream.view) {
            return Err(format!(
                "the SPZ of bufferView {} is that of two primitives",
                stream.view
            ));
        }
        views.push(stream.view);
        check_stream(document, stream.view)?;
    }
    Ok(())
}

fn begins_within(other: &Elements, one: &Elements) -> bool {
    other.buffer == one.buffer && other.start < one.extent().end
}

/// A stream that is written anew may be longer, and then moves what follows it: nothing may lie across its ends.
fn check_stream(document: &Document<'_>, view: usize) -> Result<(), String> {
    let own = &document.buffer_views[view];
    let end = own.byte_offset + own.byte_length;
    for (i, other) in document.buffer_views.iter().enumerate() {
        let there = other.byte_offset.saturating_add(other.byte_length);
        let apart = other.buffer != own.buffer || there <= own.byte_offset || other.byte_offset >= end;
        if i != view && !apart {
            return Err(format!("bufferView {i} shares bytes with the SPZ of bufferView {view}"));
        }
    }
    Ok(())
}
