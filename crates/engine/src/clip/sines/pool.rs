//! Planes averaged over squares on the CPU, and the gradient of that.
use std::borrow::Cow;

use rayon::prelude::*;

/// Planes of `height` x `width` pixels and the side of the squares that are averaged; what a last square lacks is left out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Squares {
    pub height: usize,
    pub width: usize,
    pub side: usize,
}

impl Squares {
    /// Rows and columns of squares.
    fn counts(self) -> [usize; 2] {
        [self.height / self.side, self.width / self.side]
    }

    /// Squares of a plane.
    pub fn count(self) -> usize {
        let [rows, columns] = self.counts();
        rows * columns
    }

    /// Means of each square of planes one after the other, `[planes][rows][columns]`.
    pub fn means(self, planes: &[f32]) -> Cow<'_, [f32]> {
        let Self { height, width, side } = self;
        if side == 1 || self.count() == 0 {
            return Cow::Borrowed(&planes[..planes.len() * self.count().min(1)]);
        }
        let [_, columns] = self.counts();
        let mut means = vec![0.0; planes.len() / (height * width) * self.count()];
        let parts = means
            .par_chunks_exact_mut(self.count())
            .zip(planes.par_chunks_exact(height * width));
        parts.for_each(|(means, plane)| {
            let mut line = vec![0.0; columns * side];
            for (out, rows) in means.chunks_exact_mut(columns).zip(plane.chunks_exact(side * width)) {
                line.fill(0.0);
                for row in rows.chunks_exact(width) {
                    line.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
                }
                for (out, square) in out.iter_mut().zip(line.chunks_exact(side)) {
                    *out = square.iter().sum::<f32>() * self.share();
                }
            }
        });
        Cow::Owned(means)
    }

    /// The gradient to the planes of a gradient to these means.
    pub fn spread(self, gradient: Vec<f32>) -> Vec<f32> {
        let Self { height, width, side } = self;
        if side == 1 || self.count() == 0 {
            return gradient;
        }
        let [_, columns] = self.counts();
        let mut planes = vec![0.0; gradient.len() / self.count() * height * width];
        let parts = planes
            .par_chunks_exact_mut(height * width)
            .zip(gradient.par_chunks_exact(self.count()));
        parts.for_each(|(plane, gradient)| {
            for (rows, slopes) in plane.chunks_exact_mut(side * width).zip(gradient.chunks_exact(columns)) {
                let (first, others) = rows.split_at_mut(width);
                for (square, slope) in first.chunks_exact_mut(side).zip(slopes) {
                    square.fill(slope * self.share());
                }
                others
                    .chunks_exact_mut(width)
                    .for_each(|row| row.copy_from_slice(first));
            }
        });
        planes
    }

    /// What a pixel counts in a mean.
    fn share(self) -> f32 {
        1.0 / (self.side * self.side) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_their_gradient_leave_out_what_fills_no_square() {
        let squares = Squares {
            height: 3,
            width: 5,
            side: 2,
        };
        let planes: Vec<f32> = (0..30).map(|v| v as f32).collect();
        // Rows 0 and 1, columns 0 to 3 of each plane.
        assert_eq!(squares.means(&planes)[..], [3.0, 5.0, 18.0, 20.0]);
        let spread = squares.spread(vec![4.0, 8.0, 12.0, 16.0]);
        assert_eq!(spread[..10], [1.0, 1.0, 2.0, 2.0, 0.0, 1.0, 1.0, 2.0, 2.0, 0.0]);
        assert_eq!(spread[10..17], [0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 3.0]);
    }

    #[test]
    fn squares_larger_than_a_plane_have_no_means() {
        let squares = Squares {
            height: 3,
            width: 3,
            side: 4,
        };
        assert!(squares.means(&[1.0; 9]).is_empty());
        assert_eq!(squares.spread(Vec::new()), Vec::<f32>::new());
    }
}
