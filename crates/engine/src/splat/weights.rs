//! The weights of a view, kept: what every splat contributes to every pixel.
use super::composite::{ContributionSink, TileBounds, composite_tile};
use super::project::Splat2d;
use super::tiles::{TILE, TILE_PIXELS, TileLists};
use crate::error::{Error, Result};
use crate::simd::Instructions;
use crate::view::Camera;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

/// Sparse weights of a view, one part a row of tiles.
///
/// Stored by (splat, tile) pair rather than by pixel: the pixel is then one byte, the colour is read once a pair,
/// and both the product and its transpose stay within the 4 KiB of a tile. 5 bytes a weight, or 3 in half precision.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SparseWeights {
    pub bands: Vec<Band>,
}

/// Weights of a row of tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Band {
    /// Where the entries of each slot of the band end; they begin where those of the slot before end.
    pub ends: Vec<u32>,
    /// Pixel of each entry, row-major in its tile.
    pub pixels: Box<[u8]>,
    /// Weight of each entry.
    pub weights: Numbers,
    /// Transmittance behind everything, `[columns][256]`.
    pub transmittance: Vec<[f32; TILE_PIXELS]>,
}

/// Weights, in either precision.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Numbers {
    /// As they are computed.
    Single(Box<[f32]>),
    /// Rounded to half precision. All are below 1, so none overflows; those below 6e-5 lose digits, and those below
    /// 3e-8 become 0.
    Half(Box<[f16]>),
}

impl Default for Numbers {
    fn default() -> Self {
        Numbers::Single(Box::default())
    }
}

impl Numbers {
    fn new(weights: &[f32], half: bool) -> Self {
        if half {
            let mut rounded = vec![f16::ZERO; weights.len()].into_boxed_slice();
            rounded.convert_from_f32_slice(weights);
            Numbers::Half(rounded)
        } else {
            Numbers::Single(weights.into())
        }
    }

    fn len(&self) -> usize {
        match self {
            Numbers::Single(all) => all.len(),
            Numbers::Half(all) => all.len(),
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Numbers::Single(all) => size_of_val(&all[..]),
            Numbers::Half(all) => size_of_val(&all[..]),
        }
    }

    /// The weights of one pair, at most one a pixel; `room` is where they are widened to.
    #[inline(always)]
    pub fn of<'a>(&'a self, range: std::ops::Range<usize>, room: &'a mut [f32; TILE_PIXELS]) -> &'a [f32] {
        match self {
            Numbers::Single(all) => &all[range],
            Numbers::Half(all) => {
                let room = &mut room[..range.len()];
                all[range].convert_to_f32_slice(room);
                room
            }
        }
    }
}

impl SparseWeights {
    /// Walks all tiles; weights are kept in `half` precision if asked for. Also returns which pairs matter: those with a
    /// weight, and those that ended a pixel.
    pub fn new(camera: &Camera, tiles: &TileLists, splats: &[Splat2d], half: bool) -> Result<(Self, Vec<bool>)> {
        let parts: Vec<(Band, Vec<bool>)> = (0..tiles.rows)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, row| {
                Band::new(camera, tiles, splats, row, half, scratch)
            })
            .collect::<Result<_>>()?;
        let mut keep = Vec::with_capacity(tiles.pairs());
        let mut bands = Vec::with_capacity(parts.len());
        for (band, kept) in parts {
            bands.push(band);
            keep.extend(kept);
        }
        Ok((SparseWeights { bands }, keep))
    }

    /// Number of weights.
    pub fn len(&self) -> usize {
        self.bands.iter().map(|b| b.weights.len()).sum()
    }

    /// Memory of the weights.
    pub fn bytes(&self) -> usize {
        self.bands
            .iter()
            .map(|b| 4 * b.ends.len() + b.pixels.len() + b.weights.bytes() + 4 * TILE_PIXELS * b.transmittance.len())
            .sum()
    }
}

impl Band {
    /// `scratch` is only working memory; what it holds does not matter.
    fn new(
        camera: &Camera,
        tiles: &TileLists,
        splats: &[Splat2d],
        row: u32,
        half: bool,
        scratch: &mut Scratch,
    ) -> Result<(Self, Vec<bool>)> {
        let first = (row * tiles.columns) as usize;
        let slots = (tiles.start[first + tiles.columns as usize] - tiles.start[first]) as usize;
        let instructions = Instructions::widest();
        let mut collect = Collect {
            scratch,
            begin: 0,
            end: 0,
            ends: Vec::with_capacity(slots),
            keep: Vec::with_capacity(slots),
        };
        let mut transmittance = Vec::with_capacity(tiles.columns as usize);
        for column in 0..tiles.columns {
            let list = tiles.of(first + column as usize);
            let before = collect.keep.len();
            let frame = TileBounds::new(column, row, camera.width, camera.height);
            transmittance.push(composite_tile(instructions, frame, splats, list, &mut collect));
            // Once all pixels are finished the walk ends early; the splats behind have no weight.
            collect.keep.resize(before + list.len(), false);
        }
        if collect.end > u32::MAX as usize {
            return Err(Error::BadOption {
                field: "size",
                reason: "a row of tiles has more than 2^32 weights; render a smaller picture or keep no weights".into(),
            });
        }
        let Collect { ends, keep, end, .. } = collect;
        // Copies of the exact size: growing in place would leave up to half of the memory unused.
        let pixels = scratch.pixels[..end].into();
        let weights = Numbers::new(&scratch.weights[..end], half);
        Ok((
            Band {
                ends,
                pixels,
                weights,
                transmittance,
            },
            keep,
        ))
    }
}

/// Entries of a band while it grows, kept from band to band; longer than what is in use.
#[derive(Default)]
struct Scratch {
    pixels: Vec<u8>,
    weights: Vec<f32>,
}

/// Entries that a pair may write: one a pixel, and what is written too many at a time.
const PAIR_ROOM: usize = TILE_PIXELS + TILE as usize;

struct Collect<'a> {
    scratch: &'a mut Scratch,
    /// Where the entries of the current pair begin and end.
    begin: usize,
    end: usize,
    ends: Vec<u32>,
    keep: Vec<bool>,
}

impl ContributionSink for Collect<'_> {
    #[inline(always)]
    fn begin(&mut self, _: usize, _: u32) {
        self.begin = self.end;
        let room = self.end + PAIR_ROOM;
        if self.scratch.weights.len() < room {
            self.scratch.pixels.resize(2 * room, 0);
            self.scratch.weights.resize(2 * room, 0.0);
        }
    }

    #[inline(always)]
    fn add(&mut self, pixel: usize, weight: f32) {
        self.scratch.pixels[self.end] = pixel as u8;
        self.scratch.weights[self.end] = weight;
        self.end += 1;
    }

    #[inline(always)]
    fn add_run<const W: usize>(&mut self, first: usize, weights: &[f32; W], count: usize, all: bool) {
        let to = self.end..self.end + W;
        let pixels = &mut self.scratch.pixels[to.clone()];
        let kept = &mut self.scratch.weights[to];
        if all {
            // What is behind the last is overwritten by what comes next, or not counted.
            pixels
                .iter_mut()
                .enumerate()
                .for_each(|(k, pixel)| *pixel = (first as u8).wrapping_add(k as u8));
            kept.copy_from_slice(weights);
            self.end += count;
        } else {
            let mut end = 0;
            for (k, weight) in weights[..count].iter().enumerate() {
                pixels[end] = (first + k) as u8;
                kept[end] = *weight;
                end += usize::from(*weight > 0.0);
            }
            self.end += end;
        }
    }

    #[inline(always)]
    fn end(&mut self, _: usize, stopped: bool) {
        let keep = stopped || self.end > self.begin;
        self.keep.push(keep);
        if keep {
            self.ends.push(self.end as u32);
        }
    }
}
