//! Alpha compositing of one tile on the CPU: which splat contributes how much to which pixel.
use super::project::{ALPHA_MIN, Splat2d};
use super::tiles::{TILE, TILE_PIXELS};
use crate::simd::{Instructions, Vectorised};
use bytemuck::Zeroable;

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

/// Splats that come next. They lie anywhere in memory: fetching many at once lets the cache misses overlap.
struct Fetched {
    /// With means in pixels of the tile.
    splats: [Splat2d; FETCH],
    /// First row of each, and the one behind the last.
    rows: [[u32; FETCH]; 2],
    /// Deviation along a row.
    inverse: [f32; FETCH],
}

impl Fetched {
    #[inline(always)]
    fn new() -> Self {
        Fetched {
            splats: [Splat2d::zeroed(); FETCH],
            rows: [[0; FETCH]; 2],
            inverse: [0.0; FETCH],
        }
    }

    #[inline(always)]
    fn fetch(&mut self, splats: &[Splat2d], list: &[u32], frame: TileBounds) {
        for (slot, index) in self.splats.iter_mut().zip(list) {
            *slot = splats[*index as usize];
        }
        let origin = [frame.origin[0] as f32, frame.origin[1] as f32];
        let height = frame.size[1] as f32;
        for i in 0..FETCH {
            let s = &mut self.splats[i];
            s.mean[0] -= origin[0];
            s.mean[1] -= origin[1];
            let reach = s.reach.sqrt() / s.inverse_y + ROW_SLACK;
            self.rows[0][i] = ceil_within(s.mean[1] - reach, height);
            self.rows[1][i] = floor_within(s.mean[1] + reach + 1.0, height);
            self.inverse[i] = 1.0 / s.inverse_x;
        }
    }
}

/// Where a few rows of a splat lie, and how far from its middle.
struct Spans<const W: usize> {
    /// `v^2`.
    square: [f32; W],
    /// Where the ridge is, in pixels of the tile.
    ridge: [f32; W],
    /// A bit a column.
    columns: [u32; W],
}

impl<const W: usize> Spans<W> {
    #[inline(always)]
    fn new() -> Self {
        Spans {
            square: [0.0; W],
            ridge: [0.0; W],
            columns: [0; W],
        }
    }

    /// Rows from `y` on; `inverse` is the deviation along a row.
    #[inline(always)]
    fn fill(&mut self, s: &Splat2d, inverse: f32, y: usize, width: f32) {
        for i in 0..W {
            let dy = (y as i32 + i as i32) as f32 - s.mean[1];
            let v = dy * s.inverse_y;
            let square = v * v;
            let ridge = s.mean[0] + s.slope * dy;
            let half = (s.reach - square).max(0.0).sqrt() * inverse + ROW_SLACK;
            let start = ceil_within(ridge - half, width);
            let end = floor_within(ridge + half + 1.0, width);
            self.square[i] = square;
            self.ridge[i] = ridge;
            self.columns[i] = ((1 << end) - 1) & !((1 << start) - 1);
        }
    }
}

/// A few pixels of a row.
#[derive(Clone, Copy)]
struct Run {
    /// The first, row-major in the tile.
    pixel: usize,
    /// How many, at most as there are lanes.
    count: usize,
    /// How far the first is from where `ridge` counts.
    offset: f32,
    /// How far the splat's ridge is from there.
    ridge: f32,
    /// `v^2` of the row.
    square: f32,
}

/// What splats have left of a tile's light.
struct Pixels {
    /// Of each pixel; 0 where it is finished or outside the picture.
    light: [f32; TILE_PIXELS + ROOM],
    /// What was left where it is finished; 1 outside the picture.
    last: [f32; TILE_PIXELS],
    /// A bit a pixel that is not finished: most splats of a dense scene lie behind finished pixels only.
    open: [u32; SIDE],
    open_rows: usize,
}

impl Pixels {
    #[inline(always)]
    fn new(frame: TileBounds) -> Self {
        let [width, height] = frame.size;
        let mut pixels = Pixels {
            light: [0.0; TILE_PIXELS + ROOM],
            last: [1.0; TILE_PIXELS],
            open: [0; SIDE],
            open_rows: height,
        };
        for y in 0..height {
            pixels.light[y * SIDE..][..width].fill(1.0);
            pixels.last[y * SIDE..][..width].fill(0.0);
            pixels.open[y] = (1 << width) - 1;
        }
        pixels
    }

    /// Covers a few pixels with a splat, with these weights; returns whether all are above 0.
    #[inline(always)]
    fn cover<const W: usize>(&mut self, weights: &mut [f32; W], s: &Splat2d, run: Run, stopped: &mut bool) -> bool {
        let light = &mut self.light[run.pixel..][..W];
        let (mut alphas, mut before) = ([0.0; W], [0.0; W]);
        before.copy_from_slice(light);
        let mut gaps = 0;
        for k in 0..W {
            let u = (run.offset + k as f32 - run.ridge) * s.inverse_x;
            let alpha = (s.opacity * exp(-0.5 * (u * u + run.square))).min(ALPHA_MAX);
            let left = before[k] * (1.0 - alpha);
            let inside = (k as i32) < run.count as i32;
            let adds = inside & (alpha >= ALPHA_MIN) & (left >= TRANSMITTANCE_MIN);
            weights[k] = if adds { alpha * before[k] } else { 0.0 };
            light[k] = if adds { left } else { before[k] };
            alphas[k] = alpha;
            gaps |= i32::from(inside & !adds);
        }
        if gaps != 0 {
            for k in 0..run.count {
                // It saw light, and leaves too little.
                if alphas[k] >= ALPHA_MIN && before[k] > 0.0 && weights[k] == 0.0 {
                    self.finish(run.pixel + k);
                    *stopped = true;
                }
            }
        }
        gaps == 0
    }

    /// Nothing adds to a pixel any more.
    fn finish(&mut self, pixel: usize) {
        let y = pixel / SIDE;
        self.last[pixel] = self.light[pixel];
        self.light[pixel] = 0.0;
        self.open[y] &= !(1 << (pixel % SIDE));
        self.open_rows -= usize::from(self.open[y] == 0);
    }

    #[inline(always)]
    fn transmittance(self) -> [f32; TILE_PIXELS] {
        let mut all = self.last;
        for (all, light) in all.iter_mut().zip(self.light) {
            // One of both is 0.
            *all += light;
        }
        all
    }
}

/// Adding it to a number from 0 to 255 rounds that to a whole number in the lowest bits.
const ROUND: f32 = 8_388_608.0;

/// `x` rounded up, from 0 to `limit`, which is at most 255; 0 for NaN. Without a conversion to integers, whose limits take
/// longer than the rest.
#[inline(always)]
fn ceil_within(x: f32, limit: f32) -> u32 {
    let x = within(x, limit);
    let rounded = x + ROUND;
    (rounded.to_bits() & 0xff) + u32::from(rounded - ROUND < x)
}

/// `x` rounded down, from 0 to `limit`, which is at most 255; 0 for NaN.
#[inline(always)]
fn floor_within(x: f32, limit: f32) -> u32 {
    let x = within(x, limit);
    let rounded = x + ROUND;
    (rounded.to_bits() & 0xff) - u32::from(rounded - ROUND > x)
}

#[inline(always)]
fn within(x: f32, limit: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < limit { x } else { limit }
}

/// e^x for x <= 0 to about one unit in the last place, 0-like below -80; without branches, so that it vectorises.
///
/// Range reduction by ln 2 in two parts and the polynomial of Cephes' `expf` (Moshier).
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Adding 1.5 * 2^23 rounds to an integer in the low mantissa bits; 127 is the exponent's bias.
    const ROUND: f32 = 12_582_912.0 + 127.0;
    let x = x.max(-80.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = x - n * 0.693_359_4 + n * 2.121_944_4e-4;
    let mut p = 1.987_569_1e-4f32;
    p = p * r + 1.398_199_9e-3;
    p = p * r + 8.333_452e-3;
    p = p * r + 4.166_579_6e-2;
    p = p * r + 1.666_666_5e-1;
    p = p * r + 0.5;
    let p = p * (r * r) + r + 1.0;
    p * f32::from_bits(shifted.to_bits() << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_that_of_the_standard_library() {
        for x in (-40..400)
            .map(|i| i as f32 * 0.061)
            .chain([0.0, 1.0, 15.0, 16.0, 7.999_999_5, 8.000_001])
        {
            let expected = x.clamp(0.0, 16.0);
            assert_eq!(ceil_within(x, 16.0), expected.ceil() as u32, "{x}");
            assert_eq!(floor_within(x, 16.0), expected.floor() as u32, "{x}");
        }
        let none = [f32::NAN, f32::NEG_INFINITY].map(|x| [ceil_within(x, 9.0), floor_within(x, 9.0)]);
        assert_eq!(none, [[0, 0]; 2]);
        assert_eq!(
            [ceil_within(f32::INFINITY, 9.0), floor_within(f32::INFINITY, 9.0)],
            [9, 9]
        );
    }

    #[test]
    fn exponential_is_accurate_to_two_units_in_the_last_place() {
        for i in 0..=800_000 {
            let x = -(i as f32) * 1e-4;
            let (got, want) = (f64::from(exp(x)), f64::from(x).exp());
            assert!((got / want - 1.0).abs() < 2.4e-7, "exp({x}) = {got}, not {want}");
        }
        assert!(exp(f32::NEG_INFINITY) < 1e-34 && exp(-1e30) >= 0.0);
    }
}
