//! The weights of a view, kept: what every splat contributes to every pixel.
use super::project::Splat2d;
use super::tiles::{TILE_PIXELS, TileLists};
use super::walk::{Sink, TileFrame, walk};
use crate::error::{Error, Result};
use crate::view::Camera;
use rayon::prelude::*;

/// Sparse weights of a view, one part a row of tiles.
///
/// Stored by (splat, tile) pair rather than by pixel: the pixel is then one byte, the colour is read once a pair,
/// and both the product and its transpose stay within the 4 KiB of a tile. 5 bytes a weight.
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
    pub weights: Box<[f32]>,
    /// Transmittance behind everything, `[columns][256]`.
    pub transmittance: Vec<[f32; TILE_PIXELS]>,
}

impl SparseWeights {
    /// Walks all tiles. Also returns which pairs matter: those with a weight, and those that ended a pixel.
    pub fn new(camera: &Camera, tiles: &TileLists, splats: &[Splat2d]) -> Result<(Self, Vec<bool>)> {
        let parts: Vec<(Band, Vec<bool>)> = (0..tiles.rows)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, row| {
                Band::new(camera, tiles, splats, row, scratch)
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
            .map(|b| 4 * b.ends.len() + 5 * b.weights.len() + 4 * TILE_PIXELS * b.transmittance.len())
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
        scratch: &mut Scratch,
    ) -> Result<(Self, Vec<bool>)> {
        let first = (row * tiles.columns) as usize;
        let slots = (tiles.start[first + tiles.columns as usize] - tiles.start[first]) as usize;
        scratch.pixels.clear();
        scratch.weights.clear();
        let mut collect = Collect {
            scratch,
            pixels: [0; TILE_PIXELS],
            weights: [0.0; TILE_PIXELS],
            count: 0,
            ends: Vec::with_capacity(slots),
            keep: Vec::with_capacity(slots),
        };
        let mut transmittance = Vec::with_capacity(tiles.columns as usize);
        for column in 0..tiles.columns {
            let list = tiles.of(first + column as usize);
            let before = collect.keep.len();
            let frame = TileFrame::new(column, row, camera.width, camera.height);
            transmittance.push(walk(frame, splats, list, &mut collect));
            // Once all pixels are finished the walk ends early; the splats behind have no weight.
            collect.keep.resize(before + list.len(), false);
        }
        if collect.scratch.weights.len() > u32::MAX as usize {
            return Err(Error::BadOption {
                field: "size",
                reason: "a row of tiles has more than 2^32 weights; render a smaller picture or keep no weights".into(),
            });
        }
        let Collect { ends, keep, .. } = collect;
        // Copies of the exact size: growing in place would leave up to half of the memory unused.
        let (pixels, weights) = (scratch.pixels.as_slice().into(), scratch.weights.as_slice().into());
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

/// Entries of a band while it grows, kept from band to band.
#[derive(Default)]
struct Scratch {
    pixels: Vec<u8>,
    weights: Vec<f32>,
}

struct Collect<'a> {
    scratch: &'a mut Scratch,
    /// Entries of the current pair, at most one a pixel.
    pixels: [u8; TILE_PIXELS],
    weights: [f32; TILE_PIXELS],
    count: usize,
    ends: Vec<u32>,
    keep: Vec<bool>,
}

impl Sink for Collect<'_> {
    #[inline(always)]
    fn begin(&mut self, _: usize, _: u32) {
        self.count = 0;
    }

    #[inline(always)]
    fn add(&mut self, pixel: usize, weight: f32) {
        // The remainder changes nothing, and tells the compiler that the index is in range.
        self.pixels[self.count % TILE_PIXELS] = pixel as u8;
        self.weights[self.count % TILE_PIXELS] = weight;
        self.count += 1;
    }

    #[inline(always)]
    fn end(&mut self, _: usize, stopped: bool) {
        let keep = stopped || self.count > 0;
        self.keep.push(keep);
        if keep {
            self.scratch.pixels.extend_from_slice(&self.pixels[..self.count]);
            self.scratch.weights.extend_from_slice(&self.weights[..self.count]);
            self.ends.push(self.scratch.weights.len() as u32);
        }
    }
}
