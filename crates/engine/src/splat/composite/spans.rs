//! Which rows of a tile splats reach, and which pixels of a row.
use super::{FETCH, ROW_SLACK, TileBounds};
use crate::splat::project::Splat2d;
use bytemuck::Zeroable;

/// Splats that come next. They lie anywhere in memory: fetching many at once lets the cache misses overlap.
pub(super) struct Fetched {
    /// With means in pixels of the tile.
    pub splats: [Splat2d; FETCH],
    /// First row of each, and the one behind the last.
    pub rows: [[u32; FETCH]; 2],
    /// Deviation along a row.
    pub inverse: [f32; FETCH],
}

impl Fetched {
    #[inline(always)]
    pub fn new() -> Self {
        Fetched {
            splats: [Splat2d::zeroed(); FETCH],
            rows: [[0; FETCH]; 2],
            inverse: [0.0; FETCH],
        }
    }

    #[inline(always)]
    pub fn fetch(&mut self, splats: &[Splat2d], list: &[u32], frame: TileBounds) {
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
pub(super) struct Spans<const W: usize> {
    /// `v^2`.
    pub square: [f32; W],
    /// Where the ridge is, in pixels of the tile.
    pub ridge: [f32; W],
    /// A bit a column.
    pub columns: [u32; W],
}

impl<const W: usize> Spans<W> {
    #[inline(always)]
    pub fn new() -> Self {
        Spans {
            square: [0.0; W],
            ridge: [0.0; W],
            columns: [0; W],
        }
    }

    /// Rows from `y` on; `inverse` is the deviation along a row.
    #[inline(always)]
    pub fn fill(&mut self, s: &Splat2d, inverse: f32, y: usize, width: f32) {
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
}
