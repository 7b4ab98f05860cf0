//! Weights of a picture's pixels by how rare their colours are: histogram equalisation for averages.
//!
//! A coarse grid of colours counts pixels, each shared among the eight corners of its cell (linear binning, Silverman
//! 1982, 3.5). A pixel's density is what the corners around it hold, by its shares of them, and its weight the density to
//! the power of minus `equalization`: 0 weighs all pixels alike, 1 all colours that a picture has. The grid is much
//! coarser than what a mark changes, so a mark cannot make its own colours common.
use rayon::prelude::*;

use super::plain::is_plain;
use crate::power::power_of;
use crate::simd::{Instructions, Vectorised};

/// Least value of a channel on the grid, of normalised pictures; what is below counts as this.
pub(super) const LEAST: f32 = -2.0;
/// Corners a channel, 1 apart, which is about a quarter of the way from black to white; white is at most 2.15.
pub(super) const CORNERS: usize = 6;
/// Corners of the grid.
pub(super) const GRID: usize = CORNERS * CORNERS * CORNERS;

/// Pixels that are computed together, a register of them at a time.
const BLOCK: usize = 64;
/// Room for the grid's corners, so that an index of eight bits is in range.
const ROOM: usize = 256;
/// How far the corners of a cell are behind its first.
const BEHIND: [usize; 8] = {
    let mut behind = [0; 8];
    let mut i = 0;
    while i < 8 {
        behind[i] = ((i >> 2) * CORNERS + (i >> 1 & 1)) * CORNERS + (i & 1);
        i += 1;
    }
    behind
};

/// Weights `[views][pixels]` of normalised pictures `[views][3][pixels]`; those of a view add up to 1.
pub(super) fn weights(instructions: Instructions, pictures: &[f32], views: usize, equalization: f32) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let mut weights = vec![0.0; views * pixels];
    if pixels > 0 {
        let views = weights.par_chunks_exact_mut(pixels).zip(pictures.par_chunks_exact(len));
        views.for_each(|(weights, picture)| {
            instructions.run(Weigh {
                picture,
                equalization,
                weights,
            });
        });
    }
    weights
}

/// Of one picture. Nothing is fused: the bytes are the same on every instruction set of an architecture.
struct Weigh<'a> {
    picture: &'a [f32],
    equalization: f32,
    weights: &'a mut [f32],
}

impl Vectorised for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let power = -f64::from(self.equalization);
        let mut cells = Cells::new();
        let mut grid = [0.0_f32; ROOM];
        let pixels = self.weights.len();
        for first in (0..pixels).step_by(BLOCK) {
            let (count, plain) = cells.fill(self.picture, pixels, first);
            cells.count(&mut grid, count, plain);
        }
        let mut sums = [0.0_f64; BLOCK];
        for (block, weights) in self.weights.chunks_mut(BLOCK).enumerate() {
            let (_, plain) = cells.fill(self.picture, pixels, block * BLOCK);
            let mut found = [0.0_f32; BLOCK];
            if plain {
                found = [power_of(cells.density(&grid, 0), power); BLOCK];
            } else {
                for k in 0..BLOCK {
                    found[k] = power_of(cells.density(&grid, k), power);
                }
            }
            for ((weight, found), sum) in weights.iter_mut().zip(&found).zip(&mut sums) {
                *weight = *found;
                *sum += f64::from(*found);
            }
        }
        let scale = (1.0 / sums.iter().sum::<f64>()) as f32;
        self.weights.iter_mut().for_each(|weight| *weight *= scale);
    }
}

/// Where some pixels are on the grid.
struct Cells {
    colours: [[f32; BLOCK]; 3],
    /// The first corner of each one's cell.
    first: [u32; BLOCK],
    /// Its shares of the cell's corners.
    shares: [[f32; BLOCK]; 8],
}

impl Cells {
    #[inline(always)]
    fn new() -> Self {
        Self {
            colours: [[0.0; BLOCK]; 3],
            first: [0; BLOCK],
            shares: [[0.0; BLOCK]; 8],
        }
    }

    /// Finds pixels from `first` on in a picture of so many; returns how many there are, and whether all have one colour, of
    /// which only the first is found.
    #[inline(always)]
    fn fill(&mut self, picture: &[f32], pixels: usize, first: usize) -> (usize, bool) {
        let count = BLOCK.min(pixels - first);
        let plain = is_plain([0, 1, 2].map(|channel| &picture[channel * pixels + first..][..count]));
        for (channel, colours) in self.colours.iter_mut().enumerate() {
            colours[..count].copy_from_slice(&picture[channel * pixels + first..][..count]);
        }
        if plain {
            self.find(0);
        } else {
            for k in 0..BLOCK {
                self.find(k);
            }
        }
        (count, plain)
    }

    /// Finds the place of a pixel on the grid.
    #[inline(always)]
    fn find(&mut self, k: usize) {
        let (r, to_r) = place(self.colours[0][k]);
        let (g, to_g) = place(self.colours[1][k]);
        let (b, to_b) = place(self.colours[2][k]);
        let corners = CORNERS as f32;
        self.first[k] = whole((r * corners + g) * corners + b);
        for i in 0..8 {
            let red = if i >> 2 == 1 { to_r } else { 1.0 - to_r };
            let green = if i >> 1 & 1 == 1 { to_g } else { 1.0 - to_g };
            let blue = if i & 1 == 1 { to_b } else { 1.0 - to_b };
            self.shares[i][k] = red * green * blue;
        }
    }

    /// Adds the first `count` pixels to the grid, one after the other, or all of one colour at once.
    #[inline(always)]
    fn count(&self, grid: &mut [f32; ROOM], count: usize, plain: bool) {
        let (pixels, times) = if plain {
            (1, count as f32)
        } else {
            (count.min(BLOCK), 1.0)
        };
        for k in 0..pixels {
            for i in 0..8 {
                grid[(self.first[k] as usize + BEHIND[i]) % ROOM] += self.shares[i][k] * times;
            }
        }
    }

    /// What the corners around a pixel hold, by its shares of them.
    #[inline(always)]
    fn density(&self, grid: &[f32; ROOM], k: usize) -> f32 {
        let mut density = 0.0;
        for i in 0..8 {
            density += self.shares[i][k] * grid[(self.first[k] as usize + BEHIND[i]) % ROOM];
        }
        // A pixel alone in its cell holds an eighth at least; colours that are no numbers hold nothing.
        if density > 0.125 { density } else { 0.125 }
    }
}

/// The corner before a value, and how far it is on the way to the next; of NaN the first corner, and NaN.
#[inline(always)]
fn place(value: f32) -> (f32, f32) {
    let at = value - LEAST;
    let at = if at < 0.0 { 0.0 } else { at };
    let last = (CORNERS - 1) as f32;
    let at = if at > last { last } else { at };
    let mut corner = 0.0;
    for k in 1..CORNERS - 1 {
        corner += if at >= k as f32 { 1.0 } else { 0.0 };
    }
    (corner, at - corner)
}

/// A whole number from 0 to 255 as an integer: added to 2^23 it is in the lowest bits.
#[inline(always)]
fn whole(x: f32) -> u32 {
    (x + 8_388_608.0).to_bits() & 0xff
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three pixels of one colour and one of another, both at corners of the grid.
    const FOUR: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, -1.0, 1.0, 2.0, 2.0, 2.0, 2.0];

    /// As the formula reads, in f64.
    fn expected(picture: &[f32], equalization: f64) -> Vec<f64> {
        let pixels = picture.len() / 3;
        let corners = |pixel: usize| {
            let places: Vec<(usize, f64)> = (0..3)
                .map(|channel| {
                    let at = f64::from(picture[channel * pixels + pixel] - LEAST).clamp(0.0, 5.0);
                    let corner = (at as usize).min(CORNERS - 2);
                    (corner, at - corner as f64)
                })
                .collect();
            (0..8).map(move |i| {
                let far = [i >> 2, i >> 1 & 1, i & 1];
                let share = |k: usize| if far[k] == 1 { places[k].1 } else { 1.0 - places[k].1 };
                let corner = (0..3).fold(0, |at, k| at * CORNERS + places[k].0 + far[k]);
                (corner, share(0) * share(1) * share(2))
            })
        };
        let mut grid = [0.0; GRID];
        (0..pixels)
            .flat_map(corners)
            .for_each(|(corner, share)| grid[corner] += share);
        let density = |pixel| corners(pixel).map(|(corner, share)| share * grid[corner]).sum::<f64>();
        let weights: Vec<f64> = (0..pixels).map(|p| density(p).max(0.125).powf(-equalization)).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter().map(|w| w / sum).collect()
    }

    #[test]
    fn weights_are_those_of_the_formula_and_the_same_on_every_instruction_set() {
        let channels = [(0.013, 1.9, 0.2), (0.0071, 1.2, 0.4), (0.031, 2.4, -0.3)];
        let value = |(rate, size, shift): (f32, f32, f32)| move |i: usize| shift + size * (i as f32 * rate).sin();
        let picture: Vec<f32> = channels.into_iter().flat_map(|c| (0..1111).map(value(c))).collect();
        for equalization in [0.2, 1.0] {
            let wanted = expected(&picture, f64::from(equalization));
            let sets: Vec<Vec<f32>> = Instructions::present()
                .map(|set| weights(set, &picture, 1, equalization))
                .collect();
            for (found, wanted) in sets[0].iter().zip(&wanted) {
                assert!((f64::from(*found) / wanted - 1.0).abs() < 1e-6, "{found} {wanted}");
            }
            assert!(sets.iter().all(|set| *set == sets[0]));
        }
    }

    #[test]
    fn rare_colours_weigh_more() {
        let close = |found: Vec<f32>, expected: [f32; 4]| {
            let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close, "{found:?} {expected:?}");
        };
        close(weights(Instructions::widest(), &FOUR, 1, 0.0), [0.25; 4]);
        // Each of the two colours half of all.
        close(
            weights(Instructions::widest(), &FOUR, 1, 1.0),
            [1.0 / 6.0, 1.0 / 6.0, 0.5, 1.0 / 6.0],
        );
        let (common, sum) = (3.0_f32.powf(-0.5), 3.0_f32.sqrt() + 1.0);
        close(
            weights(Instructions::widest(), &FOUR, 1, 0.5),
            [common, common, 1.0, common].map(|w| w / sum),
        );
    }

    #[test]
    fn a_change_much_smaller_than_a_cell_hardly_changes_weights() {
        let picture = |change: f32| -> Vec<f32> {
            (0..300)
                .map(|i| (i as f32 * 0.37).sin() + change * (i as f32 * 1.7).cos())
                .collect()
        };
        let (before, after) = (
            weights(Instructions::widest(), &picture(0.0), 1, 0.2),
            weights(Instructions::widest(), &picture(0.05), 1, 0.2),
        );
        for (a, b) in before.iter().zip(&after) {
            assert!((a / b - 1.0).abs() < 0.03, "{a} {b}");
        }
    }

    #[test]
    fn whatever_colours_come_weights_are_finite_and_add_up_to_one() {
        let odd = [
            f32::NAN,
            f32::INFINITY,
            -1e30,
            0.3,
            5.0,
            -7.0,
            0.0,
            2.15,
            -2.0,
            1e-30,
            0.1,
            -0.1,
        ];
        let found = weights(Instructions::widest(), &odd, 1, 1.0);
        assert!(found.iter().all(|w| w.is_finite() && *w > 0.0), "{found:?}");
        assert!((found.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!(weights(Instructions::widest(), &[], 0, 1.0).is_empty());
    }
}
