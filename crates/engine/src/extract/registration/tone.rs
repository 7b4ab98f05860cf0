//! What was done to the tones of a picture, from two pictures of one view: least squares over its pixels.
use crate::extract::linear::solve;

/// Least square of a gain that is undone: what a filter flattened nearly is not blown up.
const LEAST_GAIN: f64 = 1e-2;

/// Changes of red, green and blue as a sum of N terms of a colour.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tone<const N: usize>([[f64; 3]; N]);

impl<const N: usize> Tone<N> {
    /// Fitted to pixels: their weights, terms, and changes. `no_change` is the weight of no change at all, for each pixel: a
    /// scene of one colour says little of others.
    pub fn fitted(pixels: impl Iterator<Item = (f64, [f64; N], [f64; 3])>, no_change: f64) -> Self {
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
            a[N * p + p] += no_change * total.max(1e-6);
        }
        let solved = solve(a, y, 0.0).unwrap_or_default();
        Self(std::array::from_fn(|p| solved.get(p).copied().unwrap_or_default()))
    }

    /// The change of a colour of these terms.
    pub fn change(&self, terms: &[f64; N]) -> [f64; 3] {
        std::array::from_fn(|k| terms.iter().zip(&self.0).map(|(term, factors)| term * factors[k]).sum())
    }
}

impl Tone<10> {
    /// What a small difference from the changed colour was before the change: a filter that flattens tones flattens a mark.
    /// By the gradient of the change at the colour, in the least squares sense where it has hardly any.
    pub fn undone(&self, [r, g, b]: [f64; 3], difference: [f64; 3]) -> [f64; 3] {
        let slopes: [[f64; 10]; 3] = [
            [0.0, 1.0, 0.0, 0.0, 2.0 * r, 0.0, 0.0, g, 0.0, b],
            [0.0, 0.0, 1.0, 0.0, 0.0, 2.0 * g, 0.0, r, b, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0 * b, 0.0, g, r],
        ];
        // By what channel k changes with channel j.
        let gains = slopes.map(|slopes| self.change(&slopes));
        let gain = |j: usize, k: usize| gains[j][k] + if j == k { 1.0 } else { 0.0 };
        let product = |i: usize, j: usize| (0..3).map(|k| gain(i, k) * gain(j, k)).sum::<f64>();
        let mut a: Vec<f64> = (0..9).map(|at| product(at / 3, at % 3)).collect();
        (0..3).for_each(|i| a[4 * i] += LEAST_GAIN);
        let y = (0..3).map(|j| [(0..3).map(|k| gain(j, k) * difference[k]).sum::<f64>()]);
        let solved = solve(a, y.collect(), 0.0).unwrap_or_default();
        std::array::from_fn(|j| solved.get(j).map_or(0.0, |[v]| *v))
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
        let tone = Tone::fitted(pixels, 1e-3);
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
    fn a_small_difference_is_what_it_was_before_the_filter() {
        let filter = |[r, g, b]: [f64; 3]| [0.6 * r + 0.1 * g, 0.2 + g * (1.4 - 0.5 * g), 0.9 * b * (0.5 + 0.5 * r)];
        let pixels = colours().map(|colour| {
            let after = filter(colour);
            (1.0, quadratic(colour), std::array::from_fn(|k| after[k] - colour[k]))
        });
        let tone = Tone::fitted(pixels, 1e-9);
        for colour in [[0.2, 0.5, 0.7], [0.9, 0.3, 0.4]] {
            let mark = [0.01, -0.02, 0.015];
            let (plain, marked) = (filter(colour), filter(std::array::from_fn(|k| colour[k] + mark[k])));
            let found = tone.undone(colour, std::array::from_fn(|k| marked[k] - plain[k]));
            assert!((0..3).all(|k| (found[k] - mark[k]).abs() < 1.5e-3), "{found:?}");
        }
    }

    #[test]
    fn nothing_to_look_at_changes_nothing() {
        let none = Tone::<10>::fitted(std::iter::empty(), 1e-3);
        assert_eq!(none.change(&quadratic([0.3, 0.5, 0.9])), [0.0; 3]);
    }
}
