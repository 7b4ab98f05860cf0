//! Rasteriser for the CPU: sparse products where weights are kept, compositing anew where they are not.
use super::composite::{ContributionSink, FETCH, TileBounds, composite_tile};
use super::tiles::{TILE, TILE_PIXELS};
use super::weights::Band;
use super::{PreparedView, Rasterizer};
use crate::error::Result;
use crate::picture::Picture;
use crate::simd::Instructions;
use rayon::prelude::*;

/// Draws on the CPU with rayon. One task a row of tiles; sums are ordered, so results do not depend on the threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct CpuRasterizer;

/// RGB and a spare lane: four floats are one vector register.
type TileImage = [[f32; 4]; TILE_PIXELS];

impl Rasterizer for CpuRasterizer {
    fn name(&self) -> &str {
        "cpu"
    }

    fn render(&self, view: &PreparedView, colours: &[f32], background: [f32; 3]) -> Result<Picture> {
        view.check("colours", colours.len(), 3 * view.visible.len())?;
        let (width, height) = (view.camera.width, view.camera.height);
        let colours = colours.as_chunks().0;
        let instructions = Instructions::widest();
        let mut pixels = vec![0.0; view.picture_len()];
        pixels
            .par_chunks_mut((width * TILE * 3) as usize)
            .enumerate()
            .for_each(|(row, out)| {
                let mut cursor = view.weights.as_ref().map(|w| Cursor::new(&w.bands[row]));
                for column in 0..view.tiles.columns {
                    let list = view.tiles.of(row * view.tiles.columns as usize + column as usize);
                    let frame = TileBounds::new(column, row as u32, width, height);
                    let mut draw = Draw {
                        colours,
                        fetched: [[0.0; 4]; FETCH],
                        colour: [0.0; 4],
                        image: [[0.0; 4]; TILE_PIXELS],
                    };
                    let left = match &mut cursor {
                        Some(cursor) => cursor.replay(list, &mut draw),
                        None => &composite_tile(instructions, frame, &view.splats, list, &mut draw),
                    };
                    store(frame, width, &draw.image, left, background, out);
                }
            });
        Ok(Picture { width, height, pixels })
    }

    fn backward(&self, view: &PreparedView, picture_gradient: &[f32]) -> Result<Vec<f32>> {
        view.check("picture gradient", picture_gradient.len(), view.picture_len())?;
        let (width, height) = (view.camera.width, view.camera.height);
        let columns = view.tiles.columns as usize;
        let instructions = Instructions::widest();
        let mut slots = vec![[0.0f32; 3]; view.tiles.pairs()];
        let mut bands = Vec::with_capacity(view.tiles.rows as usize);
        let mut rest = &mut slots[..];
        for row in 0..view.tiles.rows as usize {
            let count = view.tiles.start[(row + 1) * columns] - view.tiles.start[row * columns];
            let (band, after) = rest.split_at_mut(count as usize);
            bands.push(band);
            rest = after;
        }
        bands.into_par_iter().enumerate().for_each(|(row, mut slots)| {
            let band_gradient = &picture_gradient[row * (width * TILE * 3) as usize..];
            let mut cursor = view.weights.as_ref().map(|w| Cursor::new(&w.bands[row]));
            for column in 0..columns {
                let list = view.tiles.of(row * columns + column);
                let frame = TileBounds::new(column as u32, row as u32, width, height);
                let (tile_slots, after) = slots.split_at_mut(list.len());
                slots = after;
                let mut gather = Gather {
                    gradient: load(frame, width, band_gradient),
                    sum: [0.0; 4],
                    slots: tile_slots,
                };
                match &mut cursor {
                    Some(cursor) => {
                        cursor.replay(list, &mut gather);
                    }
                    None => {
                        composite_tile(instructions, frame, &view.splats, list, &mut gather);
                    }
                }
            }
        });
        Ok(view.tiles.sum_slots(&slots))
    }
}

/// Reads back a band's kept weights, tile by tile.
struct Cursor<'a> {
    band: &'a Band,
    slot: usize,
    entry: usize,
    tile: usize,
}

impl<'a> Cursor<'a> {
    fn new(band: &'a Band) -> Self {
        Cursor {
            band,
            slot: 0,
            entry: 0,
            tile: 0,
        }
    }

    /// Gives `sink` what [`walk`] would, and returns the next tile's transmittance.
    #[inline(always)]
    fn replay(&mut self, list: &[u32], sink: &mut impl ContributionSink) -> &'a [f32; TILE_PIXELS] {
        let mut room = [0.0; TILE_PIXELS];
        for (place, &splat) in list.iter().enumerate() {
            if place % FETCH == 0 {
                sink.expect(&list[place..]);
            }
            let end = self.band.ends[self.slot + place] as usize;
            sink.begin(place, splat);
            let range = self.entry..end;
            let weights = self.band.weights.of(range.clone(), &mut room);
            for (pixel, weight) in self.band.pixels[range].iter().zip(weights) {
                sink.add(*pixel as usize, *weight);
            }
            sink.end(place, false);
            self.entry = end;
        }
        self.slot += list.len();
        self.tile += 1;
        &self.band.transmittance[self.tile - 1]
    }
}

struct Draw<'a> {
    colours: &'a [[f32; 3]],
    /// Those of the next splats: they lie anywhere in memory, and fetching many at once lets the cache misses overlap.
    fetched: [[f32; 4]; FETCH],
    colour: [f32; 4],
    image: TileImage,
}

impl ContributionSink for Draw<'_> {
    #[inline(always)]
    fn expect(&mut self, next: &[u32]) {
        for (fetched, splat) in self.fetched.iter_mut().zip(next) {
            let [red, green, blue] = self.colours[*splat as usize];
            *fetched = [red, green, blue, 0.0];
        }
    }

    #[inline(always)]
    fn begin(&mut self, place: usize, _: u32) {
        self.colour = self.fetched[place % FETCH];
    }

    #[inline(always)]
    fn add(&mut self, pixel: usize, weight: f32) {
        let out = &mut self.image[pixel];
        for j in 0..4 {
            out[j] += weight * self.colour[j];
        }
    }

    #[inline(always)]
    fn end(&mut self, _: usize, _: bool) {}
}

struct Gather<'a> {
    gradient: TileImage,
    sum: [f32; 4],
    slots: &'a mut [[f32; 3]],
}

impl ContributionSink for Gather<'_> {
    #[inline(always)]
    fn begin(&mut self, _: usize, _: u32) {
        self.sum = [0.0; 4];
    }

    #[inline(always)]
    fn add(&mut self, pixel: usize, weight: f32) {
        let g = &self.gradient[pixel];
        for j in 0..4 {
            self.sum[j] += weight * g[j];
        }
    }

    #[inline(always)]
    fn end(&mut self, place: usize, _: bool) {
        self.slots[place] = [self.sum[0], self.sum[1], self.sum[2]];
    }
}

/// Copies a tile into its band of the picture, over the background.
fn store(
    frame: TileBounds,
    width: u32,
    image: &TileImage,
    left: &[f32; TILE_PIXELS],
    background: [f32; 3],
    band: &mut [f32],
) {
    for y in 0..frame.size[1] {
        let at = 3 * (y * width as usize + frame.origin[0] as usize);
        for (x, out) in band[at..at + 3 * frame.size[0]].chunks_exact_mut(3).enumerate() {
            let pixel = y * TILE as usize + x;
            for j in 0..3 {
                out[j] = image[pixel][j] + left[pixel] * background[j];
            }
        }
    }
}

/// Copies a tile out of its band of a picture; what lies outside the picture is 0.
fn load(frame: TileBounds, width: u32, band: &[f32]) -> TileImage {
    let mut image = [[0.0; 4]; TILE_PIXELS];
    for y in 0..frame.size[1] {
        let at = 3 * (y * width as usize + frame.origin[0] as usize);
        for (x, rgb) in band[at..at + 3 * frame.size[0]].chunks_exact(3).enumerate() {
            image[y * TILE as usize + x][..3].copy_from_slice(rgb);
        }
    }
    image
}
