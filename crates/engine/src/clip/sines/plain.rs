//! Pixels of one colour, as those of a ground are, computed once.
//!
//! Most pictures of an object show a ground of one colour around it. What is computed of a pixel depends on its colour alone,
//! so pixels of one colour are one pixel that weighs as much as all of them. Looked for are whole blocks of pixels that are
//! computed together anyway: that takes a few instructions, where single pixels would take more than is gained.
use super::kernel::{Block, LANES, Lanes};

/// Whether all pixels of these parts of planes have the colour of the first, bit by bit.
#[inline(always)]
pub(super) fn is_plain(planes: [&[f32]; 3]) -> bool {
    let mut differing = 0;
    for plane in planes {
        let first = plane.first().map_or(0, |value| value.to_bits());
        for value in plane {
            differing |= value.to_bits() ^ first;
        }
    }
    differing == 0
}

/// Blocks of a part of a picture: those that are not plain, and behind them one with a pixel for each plain one.
pub(super) struct Distinct {
    pub blocks: Vec<Block>,
    /// Where each block of the picture is.
    places: Vec<Place>,
    /// Pixels of the picture.
    pixels: usize,
}

#[derive(Clone, Copy)]
enum Place {
    /// A block of its own.
    Own(usize),
    /// A lane of the last block.
    Lane(usize),
}

impl Distinct {
    /// Of pixels `first..first + count` of a planar picture, at most [`LANES`] blocks of them.
    pub fn of(picture: &[f32], first: usize, count: usize) -> Self {
        let pixels = picture.len() / 3;
        let mut stand_ins = Block([[0.0; LANES]; 3]);
        let (mut blocks, mut places, mut used) = (Vec::with_capacity(LANES), Vec::with_capacity(LANES), 0);
        for start in (first..first + count).step_by(LANES) {
            let end = (start + LANES).min(first + count);
            let planes = [0, 1, 2].map(|channel| &picture[channel * pixels..][start..end]);
            if used < LANES && planes[0].len() == LANES && is_plain(planes) {
                (0..3).for_each(|channel| stand_ins.0[channel][used] = planes[channel][0]);
                places.push(Place::Lane(used));
                used += 1;
                continue;
            }
            // What a last block lacks is 0.
            let mut block = Block([[0.0; LANES]; 3]);
            (0..3).for_each(|channel| block.0[channel][..planes[channel].len()].copy_from_slice(planes[channel]));
            places.push(Place::Own(blocks.len()));
            blocks.push(block);
        }
        if used > 0 {
            blocks.push(stand_ins);
        }
        Self {
            blocks,
            places,
            pixels: count,
        }
    }

    /// Weights of the pixels of these blocks, of weights of all pixels; what stands for a block has the sum of its weights,
    /// and what only fills a block has none.
    pub fn weights(&self, of_pixels: &[f32]) -> Vec<Lanes> {
        let mut all = vec![[0.0; LANES]; self.blocks.len()];
        for (place, weights) in self.places.iter().zip(of_pixels.chunks(LANES)) {
            match *place {
                Place::Own(block) => all[block][..weights.len()].copy_from_slice(weights),
                Place::Lane(lane) => {
                    let sum = weights.iter().map(|weight| f64::from(*weight)).sum::<f64>();
                    all[self.blocks.len() - 1][lane] = sum as f32;
                }
            }
        }
        all
    }

    /// What these blocks have now of a channel, for each pixel of the picture.
    pub fn spread(&self, channel: usize, out: &mut [f32]) {
        debug_assert_eq!(out.len(), self.pixels);
        for (place, out) in self.places.iter().zip(out.chunks_mut(LANES)) {
            match *place {
                Place::Own(block) => out.copy_from_slice(&self.blocks[block].0[channel][..out.len()]),
                Place::Lane(lane) => out.fill(self.blocks[self.blocks.len() - 1].0[channel][lane]),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_blocks_are_one_pixel_each_and_the_others_stay() {
        let count = 5 * LANES - 3;
        // The second and the third block are plain, of two colours, and the last is short.
        let value = |i: usize| match i / LANES {
            1 => 1.0,
            2 => f32::NAN,
            _ => i as f32,
        };
        let picture: Vec<f32> = (0..3).flat_map(|_| (0..count).map(value)).collect();
        let distinct = Distinct::of(&picture, 0, count);
        assert_eq!(distinct.blocks.len(), 4);
        let weights = distinct.weights(&vec![0.5; count]);
        let mut last = [0.0; LANES];
        (last[0], last[1]) = (0.5 * LANES as f32, 0.5 * LANES as f32);
        assert_eq!((weights[0], weights[3]), ([0.5; LANES], last));
        assert_eq!(weights[2][LANES - 3..], [0.0; 3]);
        let mut out = vec![0.0; count];
        distinct.spread(2, &mut out);
        assert!(out.iter().zip(&picture).all(|(a, b)| a.to_bits() == b.to_bits()));
        // One pixel that differs in one channel, and a block is not plain.
        let mut other = picture.clone();
        other[2 * count + 2 * LANES - 1] = 0.9;
        assert_eq!(Distinct::of(&other, 0, count).blocks.len(), 5);
    }
}
