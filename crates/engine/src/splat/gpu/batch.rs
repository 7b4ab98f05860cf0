//! Views of one size in one buffer, so that one launch draws all of them: a view alone has fewer tiles than a card has
//! multiprocessors.
//!
//! A view is packed as words: splats `[visible][6]`, offsets of tiles `[tiles + 1]`, splats of tiles `[pairs]`, offsets of
//! slots `[visible + 1]`, slots `[pairs]`, rows `[visible]`. A table says where they begin.
use std::ops::Range;

use super::kernels::{PARTS, PIXELS, append, chunks_of_view};
use crate::error::Result;
use crate::launch::{Buffer, grid};
use crate::memory::Limits;
use crate::splat::{PreparedView, Splat2d};
use crate::view::Camera;
use cubecl::prelude::*;

/// Floats of a splat that compositing needs: the first six of `Splat2d`.
pub(super) const SHAPE: usize = 6;

/// Words of a view's row in the table.
pub(super) const FIELDS: usize = 24;
/// Where a view's words begin, by kind.
pub(super) const SPLATS: usize = 0;
pub(super) const TILE_START: usize = 1;
pub(super) const TILE_LIST: usize = 2;
pub(super) const SLOT_START: usize = 3;
pub(super) const SLOT_LIST: usize = 4;
pub(super) const ROWS: usize = 5;
/// Visible Gaussians.
pub(super) const VISIBLE: usize = 6;
/// Gaussians, and pairs, of the group's views before it.
pub(super) const FIRST_COLOUR: usize = 7;
pub(super) const FIRST_SLOT: usize = 8;
/// Its number among all views of the batch.
pub(super) const PICTURE: usize = 9;
/// Coefficients a channel that it shows.
pub(super) const TERMS: usize = 10;
/// Three floats.
pub(super) const BACKGROUND: usize = 11;
/// The camera's centre as two floats a coordinate, of which the second is what the first lacks.
pub(super) const CENTRE: usize = 14;
pub(super) const CENTRE_REST: usize = 17;
/// The camera's axis: the direction to what is at its centre.
pub(super) const AXIS: usize = 20;
/// Chunks of tile lists of the group's views before it.
pub(super) const FIRST_CHUNK: usize = 23;

/// A view's numbers as kernels read them.
pub(crate) struct PackedView(pub(super) Vec<u32>);

impl PackedView {
    /// Of a view.
    pub fn new(view: &PreparedView) -> Self {
        let tiles = &view.tiles;
        let mut words = Vec::with_capacity(len(view));
        for splat in &view.splats {
            words.extend_from_slice(&bytemuck::cast_ref::<Splat2d, [u32; 8]>(splat)[..SHAPE]);
        }
        words.extend_from_slice(&tiles.start);
        words.extend_from_slice(&tiles.splats);
        words.extend_from_slice(&tiles.slot_start);
        words.extend_from_slice(&tiles.slots);
        words.extend_from_slice(&view.visible);
        Self(words)
    }
}

/// Words of a packed view.
pub(super) fn len(view: &PreparedView) -> usize {
    let tiles = &view.tiles;
    let lists = tiles.start.len() + tiles.splats.len() + tiles.slot_start.len() + tiles.slots.len();
    (SHAPE + 1) * view.visible.len() + lists
}

/// Which view is drawn, over which ground.
#[derive(Clone, Copy)]
pub(crate) struct Shown<'a> {
    pub view: &'a PreparedView,
    pub background: [f32; 3],
}

/// Views of one size, on the device.
pub(crate) struct Batch {
    pub groups: Vec<Group>,
    pub views: usize,
    pub width: u32,
    pub height: u32,
}

/// As many views as buffers can hold; usually all.
pub(crate) struct Group {
    pub words: Buffer,
    /// `[views][FIELDS]`.
    pub table: Buffer,
    /// Which of the batch they are.
    pub views: Range<usize>,
    /// Visible Gaussians of each.
    pub visible: Vec<usize>,
    /// (Gaussian, tile) pairs of all.
    pub pairs: usize,
    pub tile_columns: u32,
    pub tile_rows: u32,
    /// Chunks of the tile lists of all views.
    pub chunks: usize,
    /// Of the view that has most.
    pub most_chunks: usize,
}

impl Group {
    /// Visible Gaussians of all views.
    pub fn colours(&self) -> usize {
        self.visible.iter().sum()
    }

    /// Visible Gaussians of the view that has most.
    pub fn most_visible(&self) -> usize {
        self.visible.iter().copied().max().unwrap_or(0)
    }
}

/// What there is a buffer of for the views of a group.
const BUFFERS: [&str; 4] = ["splats", "gradient slots", "colours", "light before chunks"];

/// The groups that `views` fall into, so that none of their buffers takes more than `limit` bytes.
///
/// # Errors
/// [`Error::DoesNotFit`](crate::Error::DoesNotFit): a view whose buffers are larger.
pub(super) fn groups(views: &[Shown<'_>], limit: u64) -> Result<Vec<Range<usize>>> {
    let mut groups: Vec<Range<usize>> = Vec::new();
    let mut bytes = [0u64; BUFFERS.len()];
    for (index, shown) in views.iter().enumerate() {
        let own = bytes_of(shown.view);
        for (what, bytes) in BUFFERS.iter().zip(own) {
            Limits::of_buffers(limit).admit_buffer(&format!("the buffer of a view's {what}"), bytes)?;
        }
        let fits = bytes.iter().zip(own).all(|(all, own)| all + own <= limit);
        match groups.last_mut().filter(|_| fits) {
            Some(group) => group.end = index + 1,
            None => {
                groups.push(index..index + 1);
                bytes = [0; BUFFERS.len()];
            }
        }
        bytes.iter_mut().zip(own).for_each(|(all, own)| *all += own);
    }
    Ok(groups)
}

/// Bytes of a view's [`BUFFERS`].
fn bytes_of(view: &PreparedView) -> [u64; BUFFERS.len()] {
    [
        4 * len(view),
        12 * view.tiles.pairs(),
        12 * view.visible.len(),
        4 * PIXELS * chunks(view),
    ]
    .map(|bytes| bytes as u64)
}

/// Chunks of a view's tile lists.
fn chunks(view: &PreparedView) -> usize {
    let tiles = &view.tiles;
    chunks_of_view((tiles.columns * tiles.rows) as usize, tiles.pairs())
}

/// Puts views whose packed words are `uploaded` beside one another.
pub(super) fn group(client: &Client, views: Range<usize>, all: &[Shown<'_>], uploaded: &[Buffer]) -> Group {
    let of_group = &all[views.clone()];
    let mut table = Vec::with_capacity(FIELDS * of_group.len());
    let (mut base, mut colours, mut pairs, mut of_all, mut most_chunks) = (0, 0, 0, 0, 0);
    for (shown, picture) in of_group.iter().zip(views.clone()) {
        table.extend(row(shown, [base, colours, pairs, picture, of_all]));
        let chunks = chunks(shown.view);
        of_all += chunks;
        most_chunks = most_chunks.max(chunks);
        base += len(shown.view);
        colours += shown.view.visible.len();
        pairs += shown.view.tiles.pairs();
    }
    let words = match uploaded {
        [one] => one.clone(),
        _ => {
            let words = Buffer::empty(client, base);
            let mut at = 0;
            for parts in uploaded.chunks(PARTS) {
                let longest = parts.iter().map(|part| part.len).max().unwrap_or(0);
                let mut places = [0; PARTS];
                for (place, part) in places.iter_mut().zip(parts) {
                    *place = at as u32;
                    at += part.len;
                }
                let (count, dim) = grid(longest, parts.len());
                let part = |k: usize| parts[k.min(parts.len() - 1)].argument();
                let all = [0, 1, 2, 3].map(part);
                append_parts(client, count, dim, all, &words, places);
            }
            words
        }
    };
    let tiles = &of_group[0].view.tiles;
    Group {
        words,
        table: Buffer::of(client, &table),
        visible: of_group.iter().map(|shown| shown.view.visible.len()).collect(),
        chunks: of_all,
        most_chunks,
        views,
        pairs,
        tile_columns: tiles.columns,
        tile_rows: tiles.rows,
    }
}

/// Launches the copying of some parts.
fn append_parts(
    client: &Client,
    count: CubeCount,
    dim: CubeDim,
    [first, second, third, fourth]: [BufferArg; PARTS],
    words: &Buffer,
    [at_first, at_second, at_third, at_fourth]: [u32; PARTS],
) {
    append::launch(
        client,
        count,
        dim,
        first,
        second,
        third,
        fourth,
        words.argument(),
        at_first,
        at_second,
        at_third,
        at_fourth,
    );
}

/// A view's row in the table.
fn row(shown: &Shown<'_>, [base, first_colour, first_slot, picture, first_chunk]: [usize; 5]) -> [u32; FIELDS] {
    let (visible, tiles) = (shown.view.visible.len(), &shown.view.tiles);
    let mut row = [0; FIELDS];
    let mut at = base;
    for (field, len) in [
        (SPLATS, SHAPE * visible),
        (TILE_START, tiles.start.len()),
        (TILE_LIST, tiles.splats.len()),
        (SLOT_START, tiles.slot_start.len()),
        (SLOT_LIST, tiles.slots.len()),
        (ROWS, visible),
    ] {
        row[field] = at as u32;
        at += len;
    }
    let terms = (shown.view.degree + 1) * (shown.view.degree + 1);
    for (field, value) in [
        (VISIBLE, visible),
        (FIRST_COLOUR, first_colour),
        (FIRST_SLOT, first_slot),
        (PICTURE, picture),
        (FIRST_CHUNK, first_chunk),
        (TERMS, terms),
    ] {
        row[field] = value as u32;
    }
    let centre = centre_of(&shown.view.camera);
    let rest = centre.map(|c| (c - f64::from(c as f32)) as f32);
    for (field, values) in [
        (BACKGROUND, shown.background),
        (CENTRE, centre.map(|c| c as f32)),
        (CENTRE_REST, rest),
        (AXIS, shown.view.camera.rotation[2]),
    ] {
        row[field..field + 3].copy_from_slice(&values.map(f32::to_bits));
    }
    row
}

/// A camera's centre in world coordinates.
fn centre_of(camera: &Camera) -> [f64; 3] {
    let part = |row: usize, k: usize| f64::from(camera.rotation[row][k]) * f64::from(camera.translation[row]);
    std::array::from_fn(|k| -(0..3).map(|row| part(row, k)).sum::<f64>())
}
