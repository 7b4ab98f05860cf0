//! A median filter over square windows, channel by channel: takes noise away and keeps edges.
//!
//! T. Huang, G. Yang and G. Tang, "A fast two-dimensional median filtering algorithm" (IEEE Transactions on Acoustics, Speech
//! and Signal Processing 27, 1979): a histogram follows the window along a row, so that a pixel costs one column in and one
//! out.
use rayon::prelude::*;

use crate::picture::Picture;

/// Levels of a value, those of 8 bits: noise is more than one of them.
const LEVELS: usize = 256;

/// Medians of the windows of `2 radius + 1` pixels a side about each pixel; pixels of the edge stand for those beyond it.
pub(super) fn filtered(picture: &Picture, radius: usize) -> Picture {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let level = |v: &f32| (v.clamp(0.0, 1.0) * (LEVELS - 1) as f32).round() as u8;
    let levels = &picture.pixels.iter().map(level).collect::<Vec<u8>>();
    let mut pixels = vec![0.0; levels.len()];
    let rows = pixels.par_chunks_exact_mut((3 * width).max(1)).enumerate();
    rows.for_each(|(y, row)| {
        let lines: Vec<usize> = (0..=2 * radius)
            .map(|dy| (y + dy).saturating_sub(radius).min(height - 1) * width)
            .collect();
        for channel in 0..3 {
            let column = |x: usize| {
                lines
                    .iter()
                    .map(move |line| usize::from(levels[3 * (line + x) + channel]))
            };
            let mut window = Histogram::new(2 * radius * (radius + 1));
            for dx in 0..=2 * radius {
                column(dx.saturating_sub(radius).min(width - 1)).for_each(|level| window.add(level));
            }
            for x in 0..width {
                row[3 * x + channel] = window.median() as f32 / (LEVELS - 1) as f32;
                column(x.saturating_sub(radius)).for_each(|level| window.remove(level));
                column((x + radius + 1).min(width - 1)).for_each(|level| window.add(level));
            }
        }
    });
    Picture { pixels, ..*picture }
}

/// How often each level is in the window, and where its median was last.
struct Histogram {
    counts: [u32; LEVELS],
    /// Values of the window that come before its median.
    middle: u32,
    median: usize,
    /// Values below `median`.
    below: u32,
}

impl Histogram {
    fn new(middle: usize) -> Self {
        Self {
            counts: [0; LEVELS],
            middle: middle as u32,
            median: 0,
            below: 0,
        }
    }

    fn add(&mut self, level: usize) {
        self.counts[level] += 1;
        self.below += u32::from(level < self.median);
    }

    fn remove(&mut self, level: usize) {
        self.counts[level] -= 1;
        self.below -= u32::from(level < self.median);
    }

    fn median(&mut self) -> usize {
        while self.below > self.middle {
            self.median -= 1;
            self.below -= self.counts[self.median];
        }
        while self.below + self.counts[self.median] <= self.middle {
            self.below += self.counts[self.median];
            self.median += 1;
        }
        self.median
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The same from the definition.
    fn reference(picture: &Picture, radius: usize) -> Vec<f32> {
        let (width, height, r) = (picture.width as isize, picture.height as isize, radius as isize);
        let at = |x: isize, y: isize, c: usize| {
            let place = y.clamp(0, height - 1) * width + x.clamp(0, width - 1);
            picture.pixels[3 * place as usize + c]
        };
        let mut medians = Vec::new();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            for c in 0..3 {
                let all = (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)));
                let mut values: Vec<f32> = all.map(|(dx, dy)| at(x + dx, y + dy, c)).collect();
                values.sort_by(f32::total_cmp);
                medians.push(values[values.len() / 2]);
            }
        }
        medians
    }

    proptest! {
        #[test]
        fn medians_are_those_of_the_definition(
            width in 1_u32..9, height in 1_u32..9, radius in 1_usize..5, seed in proptest::collection::vec(0_u8..=255, 3 * 64),
        ) {
            let pixels = seed[..(3 * width * height) as usize].iter().map(|v| f32::from(*v) / 255.0).collect();
            let picture = Picture { width, height, pixels };
            let found = filtered(&picture, radius).pixels;
            let right = reference(&picture, radius);
            prop_assert!(found.iter().zip(&right).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {right:?}");
        }
    }

    #[test]
    fn a_picture_without_pixels_is_left_alone() {
        let none = Picture {
            width: 0,
            height: 0,
            pixels: vec![],
        };
        assert_eq!(filtered(&none, 3), none);
    }
}
