//! What splats leave of a tile's light.
use super::{ALPHA_MAX, ROOM, SIDE, TRANSMITTANCE_MIN, TileBounds};
use crate::splat::project::{ALPHA_MIN, Splat2d};
use crate::splat::tiles::TILE_PIXELS;

/// A few pixels of a row.
#[derive(Clone, Copy)]
pub(super) struct Run {
    /// The first, row-major in the tile.
    pub pixel: usize,
    /// How many, at most as there are lanes.
    pub count: usize,
    /// How far the first is from where `ridge` counts.
    pub offset: f32,
    /// How far the splat's ridge is from there.
    pub ridge: f32,
    /// `v^2` of the row.
    pub square: f32,
}

/// What splats have left of a tile's light.
pub(super) struct Pixels {
    /// Of each pixel; 0 where it is finished or outside the picture.
    light: [f32; TILE_PIXELS + ROOM],
    /// What was left where it is finished; 1 outside the picture.
    last: [f32; TILE_PIXELS],
    /// A bit a pixel that is not finished: most splats of a dense scene lie behind finished pixels only.
    pub open: [u32; SIDE],
    pub open_rows: usize,
}

impl Pixels {
    #[inline(always)]
    pub fn new(frame: TileBounds) -> Self {
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
    pub fn cover<const W: usize>(&mut self, weights: &mut [f32; W], s: &Splat2d, run: Run, stopped: &mut bool) -> bool {
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
    pub fn transmittance(self) -> [f32; TILE_PIXELS] {
        let mut all = self.last;
        for (all, light) in all.iter_mut().zip(self.light) {
            // One of both is 0.
            *all += light;
        }
        all
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
