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
                counts: None,
                equalization,
                weights,
            });
        });
    }
    weights
}

/// Weights of normalised colours `[3][n]` of which each is there so many times, all of them together; they add up to 1.
pub(super) fn weights_of(instructions: Instructions, colours: &[f32], counts: &[f32], equalization: f32) -> Vec<f32> {
    let mut weights = vec![0.0; counts.len()];
    instructions.run(Weigh {
        picture: colours,
        counts: Some(counts),
        equalization,
        weights: &mut weights,
    });
    weights
}

/// Of one picture. Nothing is fused: the bytes are the same on every instruction set of an architecture.
struct Weigh<'a> {
    picture: &'a [f32],
    /// How often each colour is there; once where that is not given.
    counts: Option<&'a [f32]>,
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
            match self.counts {
                None => cells.count(&mut grid, count, plain),
                Some(counts) => cells.count_times(&mut grid, &counts[first..][..count], plain),
            }
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
            if let Some(counts) = self.counts {
                let counts = &counts[block * BLOCK..];
                found.iter_mut().zip(counts).for_each(|(found, count)| *found *= count);
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
        (0..pixels).for_each(|k| self.add(grid, k, times));
    }

    /// Adds colours to the grid of which each is there so many times; only the first was found where all are alike.
    #[inline(always)]
    fn count_times(&self, grid: &mut [f32; ROOM], counts: &[f32], plain: bool) {
        for (k, times) in counts.iter().enumerate() {
            self.add(grid, if plain { 0 } else { k }, *times);
        }
    }

    /// Adds a colour to the grid, so many times.
    #[inline(always)]
    fn add(&self, grid: &mut [f32; ROOM], k: usize, times: f32) {
        for i in 0..8 {
            grid[(self.first[k] as usize + BEHIND[i]) % ROOM] += self.shares[i][k] * times;
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
mod tests;
