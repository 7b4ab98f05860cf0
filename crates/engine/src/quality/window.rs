//! SSIM's Gaussian window on the CPU: planes blurred along rows, then along columns, with zeros beyond the border.
//!
//! Eleven multiplications and additions a pixel and direction, where a product with a banded matrix takes as many as the
//! picture is wide.
use std::ops::Range;

use crate::simd::multiply_add;

/// Pixels on either side of the window's middle.
pub(super) const RADIUS: usize = 5;
/// Pixels along the window.
const TAPS: usize = 2 * RADIUS + 1;
/// Deviation of the window, pixels.
const SIGMA: f64 = 1.5;

/// Weight of a pixel so far from the window's middle along one axis; the eleven sum to 1.
pub(super) fn weight(distance: usize) -> f64 {
    let plain = |d: usize| (-((d * d) as f64) / (2.0 * SIGMA * SIGMA)).exp();
    plain(distance) / (plain(0) + 2.0 * (1..=RADIUS).map(plain).sum::<f64>())
}

/// What of two planes is blurred, pixel by pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Product {
    /// The first plane.
    First,
    /// The second plane.
    Second,
    /// The square of the first.
    FirstSquared,
    /// The square of the second.
    SecondSquared,
    /// One times the other.
    Both,
}

impl Product {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::First,
        Self::Second,
        Self::FirstSquared,
        Self::SecondSquared,
        Self::Both,
    ];

    #[inline(always)]
    fn write(self, x: &[f32], y: &[f32], out: &mut [f32]) {
        let both = out.iter_mut().zip(x.iter().zip(y));
        match self {
            Self::First => both.for_each(|(out, (x, _))| *out = *x),
            Self::Second => both.for_each(|(out, (_, y))| *out = *y),
            Self::FirstSquared => both.for_each(|(out, (x, _))| *out = x * x),
            Self::SecondSquared => both.for_each(|(out, (_, y))| *out = y * y),
            Self::Both => both.for_each(|(out, (x, y))| *out = x * y),
        }
    }
}

/// The window for planes of one width, with room for what is blurred along rows.
pub(super) struct Window {
    taps: [f32; TAPS],
    width: usize,
    line: Vec<f32>,
    across: Vec<f32>,
}

impl Window {
    /// For planes so wide.
    pub fn new(width: usize) -> Self {
        Self {
            taps: std::array::from_fn(|tap| weight(tap.abs_diff(RADIUS)) as f32),
            width,
            line: vec![0.0; width + 2 * RADIUS],
            across: Vec::new(),
        }
    }

    /// Rows `rows` of a product of two planes `[height][width]`, blurred: `[rows][width]`.
    #[inline(always)]
    pub fn blur<const FUSED: bool>(&mut self, x: &[f32], y: &[f32], product: Product, rows: Range<usize>) -> Vec<f32> {
        let width = self.width;
        let height = x.len() / width;
        self.across.clear();
        self.across.resize((rows.len() + 2 * RADIUS) * width, 0.0);
        for (number, out) in self.across.chunks_exact_mut(width).enumerate() {
            // Rows above and below the picture stay zero.
            let row = (rows.start + number).wrapping_sub(RADIUS);
            if row < height {
                let [x, y] = [x, y].map(|plane| &plane[row * width..][..width]);
                product.write(x, y, &mut self.line[RADIUS..RADIUS + width]);
                let inputs = std::array::from_fn(|tap| &self.line[tap..tap + width]);
                weigh::<FUSED>(&self.taps, inputs, out);
            }
        }
        let mut blurred = vec![0.0; rows.len() * width];
        for (row, out) in blurred.chunks_exact_mut(width).enumerate() {
            let inputs = std::array::from_fn(|tap| &self.across[(row + tap) * width..][..width]);
            weigh::<FUSED>(&self.taps, inputs, out);
        }
        blurred
    }
}

/// The weighted sum of eleven lines of one length.
#[inline(always)]
fn weigh<const FUSED: bool>(taps: &[f32; TAPS], inputs: [&[f32]; TAPS], out: &mut [f32]) {
    let inputs = inputs.map(|line| &line[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        let mut sum = taps[0] * inputs[0][i];
        for tap in 1..TAPS {
            sum = multiply_add::<FUSED>(taps[tap], inputs[tap][i], sum);
        }
        *out = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Instructions, Vectorised};

    /// Two planes, their width and what is asked for.
    struct Case<'a>([&'a [f32]; 2], usize, Product, Range<usize>);

    impl Vectorised for Case<'_> {
        type Output = Vec<f32>;

        #[inline(always)]
        fn run<const FUSED: bool>(self) -> Vec<f32> {
            let Self([x, y], width, product, rows) = self;
            Window::new(width).blur::<FUSED>(x, y, product, rows)
        }
    }

    #[test]
    fn agrees_with_the_definition_on_every_instruction_set_and_in_any_part() {
        let formula = |product: Product, x: f64, y: f64| match product {
            Product::First => x,
            Product::Second => y,
            Product::FirstSquared => x * x,
            Product::SecondSquared => y * y,
            Product::Both => x * y,
        };
        for (width, height, rows) in [(23, 17, 0..17), (23, 17, 3..9), (1, 1, 0..1), (4, 40, 30..40)] {
            let plane =
                |step: usize| -> Vec<f32> { (0..width * height).map(|i| (i * step % 11) as f32 / 11.0).collect() };
            let (x, y) = (plane(3), plane(7));
            for (product, set) in Product::ALL
                .iter()
                .flat_map(|p| Instructions::present().map(move |s| (p, s)))
            {
                let found = set.run(Case([&x, &y], width, *product, rows.clone()));
                assert_eq!(found.len(), rows.len() * width);
                for (at, value) in found.iter().enumerate() {
                    let (column, row) = (at % width, rows.start + at / width);
                    let mut expected = 0.0;
                    for v in row.saturating_sub(RADIUS)..height.min(row + RADIUS + 1) {
                        for u in column.saturating_sub(RADIUS)..width.min(column + RADIUS + 1) {
                            let value = formula(*product, f64::from(x[v * width + u]), f64::from(y[v * width + u]));
                            expected += weight(u.abs_diff(column)) * weight(v.abs_diff(row)) * value;
                        }
                    }
                    assert!(
                        (f64::from(*value) - expected).abs() < 1e-6,
                        "{set:?} {product:?} {column} {row}"
                    );
                }
            }
        }
    }
}
