//! From a file to Gaussians: which primitives the scene shows, where their bytes are, and what they are in the world.
use super::accessor::{Elements, view_range};
use super::buffers::{Buffer, Sources};
use super::document::Document;
use super::envelope::Envelope;
use super::part::{Colours, Part, Stream};
use super::placement::{Placement, placements};
use super::primitive::{EXTENSION, MAX_DEGREE, Primitive};
use super::splats::{Splats, used_degree};
use super::{File, sharing};
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, RowFilter};
use crate::{Error, spz};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Most primitives of splats.
const MOST_PARTS: usize = 1024;
/// Numbers of a Gaussian besides its colour.
const GEOMETRY: usize = 11;

/// Why a file is not read.
pub(super) enum Failure {
    Bad(String),
    /// It takes more memory than there is.
    DoesNotFit,
}

impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Failure::Bad(reason)
    }
}

/// A primitive that the scene shows.
struct Shown<'d> {
    /// For messages.
    name: String,
    primitive: &'d Primitive,
    placement: &'d Placement,
}

/// Understands a file.
pub(super) fn parse(file: Vec<u8>, bad_rows: BadRows, sources: &Sources<'_>) -> Result<(Gaussians, File), Failure> {
    let envelope = Envelope::open(file)?;
    let document = envelope.document()?;
    let placements = placements(&document)?;
    let shown = shown(&document, &placements)?;
    let mut buffers = BTreeMap::new();
    let mut parts = Vec::new();
    let mut memory = sources.memory.saturating_sub(envelope.file.len() as u64);
    let mut compressed = Vec::new();
    for one in &shown {
        let of = |reason: String| format!("{}: {reason}", one.name);
        one.primitive.check().map_err(of)?;
        let colours = match one.primitive.spz() {
            None => {
                let splats = Splats::locate(&document, one.primitive).map_err(of)?;
                for elements in splats.all() {
                    load(&mut buffers, &envelope, &document, elements.buffer, sources)?;
                }
                take(&mut memory, splats.count(), splats.degree())?;
                compressed.push(None);
                Colours::Attributes(Box::new(splats))
            }
            Some(view) => {
                refuse_both(&document, one.primitive).map_err(of)?;
                let (buffer, _) = view_range(&document, view).map_err(of)?;
                let buffer = load(&mut buffers, &envelope, &document, buffer.buffer, sources)?;
                let (stream, gaussians) = stream(&document, view, buffer.bytes(&envelope), &mut memory)
                    .map_err(|failure| failure.of(&one.name))?;
                compressed.push(Some(gaussians));
                Colours::Spz(Box::new(stream))
            }
        };
        let count = match (&colours, compressed.last()) {
            (Colours::Attributes(splats), _) => splats.count(),
            (_, Some(Some(gaussians))) => gaussians.len(),
            _ => 0,
        };
        parts.push(Part {
            first: parts.last().map_or(0, |last: &Part| last.first + last.count),
            count,
            turn: one.placement.turn(),
            colours,
        });
    }
    let bytes = |buffer: usize| buffers.get(&buffer).map_or(&[][..], |b: &Buffer| b.bytes(&envelope));
    // Of coefficients that are shared by many splats none may be changed; those that are 0 are not.
    let degree = parts.iter().map(|part| part_degree(part, bytes)).max().unwrap_or(0);
    sharing::check(&document, &parts, degree)?;
    let mut gaussians = Gaussians::default();
    gaussians.sh.degree = degree;
    let mut sieve = RowFilter::new(bad_rows);
    for ((part, one), compressed) in parts.iter().zip(&shown).zip(compressed) {
        match (&part.colours, compressed) {
            (Colours::Attributes(splats), _) => {
                let place = (one.placement, part.turn.as_ref());
                splats
                    .decode(bytes, place, degree, &mut gaussians, &mut sieve)
                    .map_err(|reason| format!("{}: {reason}", one.name))?;
            }
            (Colours::Spz(_), Some(own)) => place(own, one.placement, part, &mut gaussians),
            (Colours::Spz(_), None) => (),
        }
    }
    let ignored = sieve.finish();
    ignored.take_from(&mut gaussians);
    if gaussians.sh.degree > 0 {
        gaussians.sh.trim();
    }
    let degree = gaussians.sh.degree;
    let file = File {
        buffers,
        parts,
        ignored,
        degree,
        envelope,
    };
    Ok((gaussians, file))
}

impl Failure {
    fn of(self, name: &str) -> Failure {
        match self {
            Failure::Bad(reason) => Failure::Bad(format!("{name}: {reason}")),
            other => other,
        }
    }
}

/// The primitives of splats that the scene shows, in the order of the file; `Err` where there are none, or too many.
fn shown<'d>(document: &'d Document<'_>, placements: &'d [Option<Placement>]) -> Result<Vec<Shown<'d>>, String> {
    let mut all = Vec::new();
    for (m, (mesh, placement)) in document.meshes.iter().zip(placements).enumerate() {
        let Some(placement) = placement else { continue };
        all.extend(mesh.splats.iter().map(|(p, primitive)| Shown {
            name: format!("primitive {p} of mesh {m}"),
            primitive,
            placement,
        }));
        if all.len() > MOST_PARTS {
            return Err(format!("more than {MOST_PARTS} primitives of splats, the limit"));
        }
    }
    if all.is_empty() {
        return Err(format!(
            "not a scene of Gaussians: a glTF whose scene shows no primitive with {EXTENSION}"
        ));
    }
    Ok(all)
}

/// Loads a buffer once.
fn load<'b>(
    buffers: &'b mut BTreeMap<usize, Buffer>,
    envelope: &Envelope,
    document: &Document<'_>,
    index: usize,
    sources: &Sources<'_>,
) -> Result<&'b Buffer, String> {
    use std::collections::btree_map::Entry;
    match buffers.entry(index) {
        Entry::Occupied(there) => Ok(there.into_mut()),
        Entry::Vacant(place) => Ok(place.insert(Buffer::load(envelope, document, index, sources)?)),
    }
}

/// Takes the bytes of so many Gaussians from those that there are.
fn take(memory: &mut u64, count: usize, degree: usize) -> Result<(), Failure> {
    let each = 4 * (GEOMETRY + 3 * (degree + 1) * (degree + 1)) as u64;
    let left = each
        .checked_mul(count as u64)
        .and_then(|bytes| memory.checked_sub(bytes));
    *memory = left.ok_or(Failure::DoesNotFit)?;
    Ok(())
}

/// Splats that are there twice, compressed and not, would be marked once.
fn refuse_both(document: &Document<'_>, primitive: &Primitive) -> Result<(), String> {
    let there = |index: &usize| document.accessors.get(*index).is_some_and(|a| a.buffer_view.is_some());
    match primitive.attributes.harmonics() {
        Ok(all) if all.iter().any(there) => Err("spherical harmonics as attributes beside those of an SPZ".into()),
        _ => Ok(()),
    }
}

/// The SPZ in a buffer view, and its Gaussians in the space of its node.
fn stream(
    document: &Document<'_>,
    view: usize,
    buffer: &[u8],
    memory: &mut u64,
) -> Result<(Stream, Gaussians), Failure> {
    let (json, range) = view_range(document, view)?;
    let bytes = &buffer[range.clone()];
    if !spz::is_spz(bytes) {
        return Err(format!("bufferView {view} is no SPZ").into());
    }
    let size = bytes.len() as u64;
    let summary = spz::summary(bytes, size)?;
    let degree = summary.degree as usize;
    take(memory, usize::try_from(summary.gaussians).unwrap_or(usize::MAX), degree)?;
    *memory = memory.checked_sub(summary.file).ok_or(Failure::DoesNotFit)?;
    let mut source = BufReader::new(bytes);
    let read = source
        .fill_buf()
        .map_err(|error| error.to_string())
        .map(|_| ())
        .and_then(|()| {
            spz::read(Path::new("SPZ"), &mut source, size).map_err(|error| match error {
                Error::BadScene { reason, .. } => reason,
                other => other.to_string(),
            })
        });
    let (gaussians, file) = read.map_err(|reason| format!("bufferView {view}: {reason}"))?;
    let sh = gaussians.sh.clone();
    let stream = Stream {
        view,
        buffer: json.buffer,
        range,
        file,
        sh,
        degree,
    };
    Ok((stream, gaussians))
}

/// The highest band in use.
fn part_degree<'b>(part: &Part, bytes: impl Fn(usize) -> &'b [u8]) -> usize {
    match &part.colours {
        Colours::Attributes(splats) => used_degree(splats, bytes).min(MAX_DEGREE),
        Colours::Spz(stream) => stream.sh.degree,
    }
}

/// Adds Gaussians of a node's space to those of the world, whose degree is at least as high.
fn place(own: Gaussians, placement: &Placement, part: &Part, all: &mut Gaussians) {
    all.positions
        .extend(own.positions.iter().map(|p| placement.position(*p)));
    all.rotations
        .extend(own.rotations.iter().map(|q| placement.rotation(*q)));
    let scales = own
        .log_scales
        .iter()
        .map(|s| s.map(|log| placement.log_scale(f64::from(log))));
    all.log_scales.extend(scales);
    all.opacity_logits.extend(own.opacity_logits);
    let Sh { degree, coefficients } = own.sh;
    let (each, room) = (3 * (degree + 1) * (degree + 1), all.sh.per_gaussian());
    for row in coefficients.chunks_exact(each) {
        let mut row = row.to_vec();
        if let Some(turn) = &part.turn {
            super::splats::turn_row(turn, &mut row);
        }
        row.resize(room, 0.0);
        all.sh.coefficients.extend(row);
    }
}

/// Accessors of colours that are written, for `degree`.
pub(super) fn written(splats: &Splats, degree: usize) -> impl Iterator<Item = &Elements> {
    splats.harmonics.iter().take((degree + 1) * (degree + 1))
}
