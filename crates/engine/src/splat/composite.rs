//! Alpha compositing of one tile on the CPU: which splat contributes how much to which pixel.
use super::project::{ALPHA_MIN, Splat2d};
use super::tiles::{TILE, TILE_PIXELS};
use bytemuck::Zeroable;

/// Largest opacity of a splat at a pixel.
pub const ALPHA_MAX: f32 = 0.99;
/// A pixel is finished when its transmittance would fall below this.
pub const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Pixels by which a row's bounds are widened against rounding.
const ROW_SLACK: f32 = 0.01;
const SIDE: usize = TILE as usize;
const LANES: usize = 4;
const FETCH: usize = 64;

/// Receives the contributions to a tile, splat by splat from front to back.
pub(super) trait ContributionSink {
    /// The next splat of the tile's list begins: its place in the list and its index.
    fn begin(&mut self, place: usize, splat: u32);
    /// It adds `weight` times its colour to `pixel` (row-major in the tile).
    fn add(&mut self, pixel: usize, weight: f32);
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
pub(super) fn composite_tile(
    frame: TileBounds,
    splats: &[Splat2d],
    list: &[u32],
    sink: &mut impl ContributionSink,
) -> [f32; TILE_PIXELS] {
    let mut transmittance = [1.0f32; TILE_PIXELS];
    // A bit a pixel that is not finished: most splats of a dense scene lie behind finished pixels only.
    let mut open = [0u32; SIDE];
    open[..frame.size[1]].fill((1 << frame.size[0]) - 1);
    let mut open_rows = frame.size[1];
    let mut alphas = [0.0f32; SIDE];
    let side = [frame.size[0] as f32, frame.size[1] as f32];
    // Splats lie anywhere in memory: fetching many at once lets the cache misses overlap.
    let mut fetched = [Splat2d::zeroed(); FETCH];
    for (place, &index) in list.iter().enumerate() {
        if open_rows == 0 {
            break;
        }
        if place % FETCH == 0 {
            for (slot, index) in fetched.iter_mut().zip(&list[place..]) {
                *slot = splats[*index as usize];
            }
        }
        let s = &fetched[place % FETCH];
        sink.begin(place, index);
        let mut stopped = false;
        let mean = [s.mean[0] - frame.origin[0] as f32, s.mean[1] - frame.origin[1] as f32];
        let rows = s.reach.sqrt() / s.inverse_y + ROW_SLACK;
        let inverse = 1.0 / s.inverse_x;
        for y in whole_numbers(mean[1] - rows, mean[1] + rows, side[1]) {
            if open[y] == 0 {
                continue;
            }
            let dy = y as f32 - mean[1];
            let v = dy * s.inverse_y;
            let ridge = mean[0] + s.slope * dy;
            let half = (s.reach - v * v).max(0.0).sqrt() * inverse + ROW_SLACK;
            let columns = whole_numbers(ridge - half, ridge + half, side[0]);
            let wanted = open[y] & ((1 << columns.end) - 1) & !((1 << columns.start) - 1);
            if columns.is_empty() || wanted == 0 {
                continue;
            }
            let (first, last) = (wanted.trailing_zeros() as usize, wanted.ilog2() as usize);
            let count = last - first + 1;
            fill_alphas(
                &mut alphas[..count.next_multiple_of(LANES)],
                s,
                ridge - first as f32,
                v * v,
            );
            let row = y * SIDE + first;
            for k in 0..count {
                let alpha = alphas[k];
                if alpha < ALPHA_MIN || wanted >> (first + k) & 1 == 0 {
                    continue;
                }
                let t = &mut transmittance[row + k];
                let left = *t * (1.0 - alpha);
                if left < TRANSMITTANCE_MIN {
                    open[y] &= !(1 << (first + k));
                    open_rows -= usize::from(open[y] == 0);
                    stopped = true;
                } else {
                    sink.add(row + k, alpha * *t);
                    *t = left;
                }
            }
        }
        sink.end(place, stopped);
    }
    transmittance
}

/// The whole numbers from `low` to `high` that are at least 0 and below `limit`.
#[inline(always)]
fn whole_numbers(low: f32, high: f32, limit: f32) -> std::ops::Range<usize> {
    // Conversions to integers truncate, send NaN and negative numbers to 0 and are fast, unlike `ceil` before SSE 4.1.
    let low = low.min(limit);
    let start = low as u32;
    let start = start + u32::from((start as f32) < low);
    let end = if high >= 0.0 { (high + 1.0).min(limit) as u32 } else { 0 };
    start as usize..end as usize
}

/// Alphas along a row whose first pixel is `ridge` pixels left of the splat's ridge; `row_power` is `v^2`.
#[inline(always)]
fn fill_alphas(out: &mut [f32], s: &Splat2d, ridge: f32, row_power: f32) {
    for (block, lanes) in out.chunks_exact_mut(LANES).enumerate() {
        for (lane, out) in lanes.iter_mut().enumerate() {
            let u = ((block * LANES + lane) as f32 - ridge) * s.inverse_x;
            *out = (s.opacity * exp(-0.5 * (u * u + row_power))).min(ALPHA_MAX);
        }
    }
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
    fn exponential_is_accurate_to_two_units_in_the_last_place() {
        for i in 0..=800_000 {
            let x = -(i as f32) * 1e-4;
            let (got, want) = (f64::from(exp(x)), f64::from(x).exp());
            assert!((got / want - 1.0).abs() < 2.4e-7, "exp({x}) = {got}, not {want}");
        }
        assert!(exp(f32::NEG_INFINITY) < 1e-34 && exp(-1e30) >= 0.0);
    }
}
