//! Alpha compositing of one tile on the CPU: which splat contributes how much to which pixel.
mod pixels;
mod spans;

use self::pixels::{Pixels, Run};
use self::spans::{Fetched, Spans};
use super::project::Splat2d;
use super::tiles::{TILE, TILE_PIXELS};
use crate::simd::{Instructions, Vectorised};

/// Largest opacity of a splat at a pixel.
pub const ALPHA_MAX: f32 = 0.99;
/// A pixel is finished when its transmittance would fall below this.
pub const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Pixels by which a row's bounds are widened against rounding.
const ROW_SLACK: f32 = 0.01;
const SIDE: usize = TILE as usize;
/// Splats that are fetched at a time.
pub(super) const FETCH: usize = 64;
/// Room behind a tile's pixels, so that the last of them can be read with as many lanes as the first.
const ROOM: usize = 16;

/// Receives the contributions to a tile, splat by splat from front to back.
pub(super) trait ContributionSink {
    /// The next splats of the tile's list are these, or the first [`FETCH`] of them.
    #[inline(always)]
    fn expect(&mut self, _next: &[u32]) {}
    /// The next splat of the tile's list begins: its place in the list and its index.
    fn begin(&mut self, place: usize, splat: u32);
    /// It adds `weight` times its colour to `pixel` (row-major in the tile).
    fn add(&mut self, pixel: usize, weight: f32);
    /// It adds the first `count` weights times its colour to as many pixels from `first` on; those that are 0 are none.
    /// `all` when none of them is.
    #[inline(always)]
    fn add_run<const W: usize>(&mut self, first: usize, weights: &[f32; W], count: usize, all: bool) {
        for (k, weight) in weights[..count].iter().enumerate() {
            if all || *weight > 0.0 {
                self.add(first + k, *weight);
            }
        }
    }
    /// It is done; `stopped` when it ended some pixel without contributing to it.
    fn end(&mut self, place: usize, stopped: bool);
}

/// Where a tile lies.
#[derive(Clone, Copy)]
pub(super) struct TileBounds {
    /// First pixel.
    pub origin: [u32; 2],
    /// Pixels inside the picture, at most [`TILE`] each way.
    pub size: [usize; 2],
}

impl TileBounds {
    pub fn new(column: u32, row: u32, width: u32, height: u32) -> Self {
        let origin = [column * TILE, row * TILE];
        TileBounds {
            origin,
            size: [
                (width - origin[0]).min(TILE) as usize,
                (height - origin[1]).min(TILE) as usize,
            ],
        }
    }
}

/// Composites the splats of `list` and returns each pixel's final transmittance.
///
/// The bytes are the same on every instruction set of an architecture: nothing is fused.
pub(super) fn composite_tile(
    instructions: Instructions,
    frame: TileBounds,
    splats: &[Splat2d],
    list: &[u32],
    sink: &mut impl ContributionSink,
) -> [f32; TILE_PIXELS] {
    instructions.run(Composite {
        frame,
        splats,
        list,
        sink,
    })
}

struct Composite<'a, S> {
    frame: TileBounds,
    splats: &'a [Splat2d],
    list: &'a [u32],
    sink: &'a mut S,
}

impl<S: ContributionSink> Vectorised for Composite<'_, S> {
    type Output = [f32; TILE_PIXELS];

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> [f32; TILE_PIXELS] {
        // Rows of splats are three to five pixels long: wider registers would hold nothing more.
        if FUSED { self.lanes::<8>() } else { self.lanes::<4>() }
    }
}

impl<S: ContributionSink> Composite<'_, S> {
    #[inline(always)]
    fn lanes<const W: usize>(self) -> [f32; TILE_PIXELS] {
        let Composite {
            frame,
            splats,
            list,
            sink,
        } = self;
        let mut pixels = Pixels::new(frame);
        let side = [frame.size[0] as f32, frame.size[1] as f32];
        let mut fetched = Fetched::new();
        for (place, &index) in list.iter().enumerate() {
            if pixels.open_rows == 0 {
                break;
            }
            if place % FETCH == 0 {
                fetched.fetch(splats, &list[place..], frame);
                sink.expect(&list[place..]);
            }
            let at = place % FETCH;
            let s = &fetched.splats[at];
            sink.begin(place, index);
            let mut stopped = false;
            let rows = fetched.rows[0][at] as usize..fetched.rows[1][at] as usize;
            for y in rows.clone().step_by(W) {
                let mut spans = Spans::<W>::new();
                spans.fill(s, fetched.inverse[at], y, side[0]);
                for i in 0..W.min(rows.end - y) {
                    let wanted = pixels.open[y + i] & spans.columns[i];
                    if wanted == 0 {
                        continue;
                    }
                    let (first, last) = (wanted.trailing_zeros() as usize, wanted.ilog2() as usize);
                    let ridge = spans.ridge[i] - first as f32;
                    for at in (first..=last).step_by(W) {
                        let count = (last + 1 - at).min(W);
                        let run = Run {
                            pixel: (y + i) * SIDE + at,
                            count,
                            offset: (at - first) as f32,
                            ridge,
                            square: spans.square[i],
                        };
                        let mut weights = [0.0; W];
                        let all = pixels.cover(&mut weights, s, run, &mut stopped);
                        sink.add_run(run.pixel, &weights, count, all);
                    }
                }
            }
            sink.end(place, stopped);
        }
        pixels.transmittance()
    }
}
