//! What was done to the tones of a picture, from two pictures of one view: least squares over its pixels.
use crate::extract::linear::solve;

/// Weight of no change at all, for each pixel: a scene of one colour says little of others.
const NO_CHANGE: f64 = 1e-3;

/// Changes of red, green and blue as a sum of N terms of a colour.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tone<const N: usize>([[f64; 3]; N]);

impl<const N: usize> Tone<N> {
    /// Fitted to pixels: their weights, terms, and changes.
    pub fn fitted(pixels: impl Iterator<Item = (f64, [f64; N], [f64; 3])>) -> Self {
        let (mut a, mut y, mut total) = (vec![0.0; N * N], vec![[0.0; 3]; N], 0.0);
        for (weight, terms, change) in pixels {
            total += weight;
            for (p, term) in terms.iter().enumerate() {
                let weighted = weight * term;
                (0..=p).for_each(|q| a[N * p + q] += weighted * terms[q]);
                (0..3).for_each(|k| y[p][k] += weighted * change[k]);
            }
        }
        for p in 0..N {
            a[N * p + p] += NO_CHANGE * total.max(1e-6);
        }
        let solved = solve(a, y, 0.0).unwrap_or_default();
        Self(std::array::from_fn(|p| solved.get(p).copied().unwrap_or_default()))
    }

    /// The change of a colour of these terms.
    pub fn change(&self, terms: &[f64; N]) -> [f64; 3] {
        std::array::from_fn(|k| terms.iter().zip(&self.0).map(|(term, factors)| term * factors[k]).sum())
    }
}

/// Terms of degree two: filters bend tones and mix channels.
pub(super) fn quadratic([r, g, b]: [f64; 3]) -> [f64; 10] {
    [1.0, r, g, b, r * r, g * g, b * b, r * g, g * b, b * r]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colours() -> impl Iterator<Item = [f64; 3]> {
        (0..600).map(|i| [(i % 7) as f64 / 6.0, (i % 11) as f64 / 10.0, (i % 13) as f64 / 12.0])
    }

    #[test]
    fn a_filter_is_found_from_its_pixels() {
        let filter = |[r, g, b]: [f64; 3]| [1.1 * r + 0.02, g * g, 0.8 * b + 0.1 * r];
        let pixels = colours().map(|colour| {
            let after = filter(colour);
            (1.0, quadratic(colour), std::array::from_fn(|k| after[k] - colour[k]))
        });
        let tone = Tone::fitted(pixels);
        let error = |colour: [f64; 3]| {
            let (change, after) = (tone.change(&quadratic(colour)), filter(colour));
            (0..3).map(|k| (colour[k] + change[k] - after[k]).abs()).sum::<f64>() / 3.0
        };
        let mean = |error: &dyn Fn([f64; 3]) -> f64| colours().map(error).sum::<f64>() / 600.0;
        let before = mean(&|colour| {
            let after = filter(colour);
            (0..3).map(|k| (colour[k] - after[k]).abs()).sum::<f64>() / 3.0
        });
        let after = mean(&error);
        // No change at all has a little weight.
        assert!(before > 0.07 && after < 0.01, "{before} {after}");
    }

    #[test]
    fn nothing_to_look_at_changes_nothing() {
        let none = Tone::<10>::fitted(std::iter::empty());
        assert_eq!(none.change(&quadratic([0.3, 0.5, 0.9])), [0.0; 3]);
    }
}
