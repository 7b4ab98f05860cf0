//! Pictures that were stored smaller or larger, at their original size again.
use burn::tensor::Tensor;

use crate::matrices::{Lines, resample};

/// Resizes pictures `[b, 3, h, w]` by one factor each (bilinear, antialiased) and back.
///
/// A reader resizes what it gets to one size anyway, so that scaling is a loss of resolution to it, and not a zoom.
/// Factors below 1 lose much of it; factors above 1 blur a little, of the finest pattern a quarter is left at 2. Both ways are one matrix along each axis.
pub(crate) fn scaling(pictures: Tensor<4>, factors: &[f32]) -> Tensor<4> {
    let [_, _, h, w] = pictures.dims();
    let lines = |side| -> Vec<_> { factors.iter().map(|&factor| there_and_back(side, factor)).collect() };
    resample(pictures, &lines(h), &lines(w))
}

fn there_and_back(side: usize, factor: f32) -> Lines {
    let stored = ((f64::from(factor) * side as f64).round() as usize).max(1);
    if stored == side {
        return Lines::identity(side);
    }
    Lines::resize(side, stored).then(&Lines::resize(stored, side))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How much of the finest pattern, alternating pixels, is left.
    fn kept(factor: f32) -> f32 {
        let side = 64;
        let lines = there_and_back(side, factor);
        let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let squares = lines.weights.chunks_exact(side).map(|row| {
            let value: f32 = row.iter().enumerate().map(|(i, weight)| weight * sign(i)).sum();
            value * value
        });
        (squares.sum::<f32>() / side as f32).sqrt()
    }

    #[test]
    fn shrinking_loses_fine_patterns_and_enlarging_keeps_some() {
        assert!(kept(0.5) < 0.05 && kept(0.75) < 0.4, "{} {}", kept(0.5), kept(0.75));
        // By hand 1/4 inside and 4/7 at both ends.
        assert!((kept(2.0) - 0.266).abs() < 0.002, "{}", kept(2.0));
        assert_eq!(kept(1.0), 1.0);
        assert_eq!(there_and_back(5, 0.01).to, 5);
    }
}
