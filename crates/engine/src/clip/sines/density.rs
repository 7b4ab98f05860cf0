//! Weights of a picture's pixels by how rare their colours are: histogram equalisation for averages.
//!
//! A coarse grid of colours counts pixels, each shared among the eight corners of its cell (linear binning, Silverman
//! 1982, 3.5). A pixel's density is what the corners around it hold, by its shares of them, and its weight the density to
//! the power of minus `equalization`: 0 weighs all pixels alike, 1 all colours that a picture has. The grid is much
//! coarser than what a mark changes, so a mark cannot make its own colours common.
use rayon::prelude::*;

/// Least value of a channel on the grid, of normalised pictures; what is below counts as this.
pub(super) const LEAST: f32 = -2.0;
/// Corners a channel, 1 apart, which is about a quarter of the way from black to white; white is at most 2.15.
pub(super) const CORNERS: usize = 6;
/// Corners of the grid.
pub(super) const GRID: usize = CORNERS * CORNERS * CORNERS;

/// Weights `[views][pixels]` of normalised pictures `[views][3][pixels]`; those of a view add up to 1.
pub(super) fn weights(pictures: &[f32], views: usize, equalization: f32) -> Vec<f32> {
    let len = pictures.len() / views.max(1);
    let pixels = len / 3;
    let mut weights = vec![0.0; views * pixels];
    if pixels > 0 {
        let views = weights.par_chunks_exact_mut(pixels).zip(pictures.par_chunks_exact(len));
        views.for_each(|(weights, picture)| of_picture(picture, equalization, weights));
    }
    weights
}

fn of_picture(picture: &[f32], equalization: f32, weights: &mut [f32]) {
    let pixels = weights.len();
    let colour = |pixel: usize| std::array::from_fn(|channel| picture[channel * pixels + pixel]);
    let mut grid = vec![0.0_f32; GRID];
    for pixel in 0..pixels {
        for (corner, share) in corners(colour(pixel)) {
            grid[corner] += share;
        }
    }
    let mut sum = 0.0_f64;
    for (pixel, weight) in weights.iter_mut().enumerate() {
        let shares = corners(colour(pixel));
        let density: f32 = shares.iter().map(|(corner, share)| share * grid[*corner]).sum();
        // A pixel alone in its cell holds an eighth at least; colours that are no numbers hold nothing.
        *weight = density.max(0.125).powf(-equalization);
        sum += f64::from(*weight);
    }
    let scale = (1.0 / sum) as f32;
    weights.iter_mut().for_each(|weight| *weight *= scale);
}

/// The eight corners around a colour, and its shares of them.
#[inline(always)]
fn corners(colour: [f32; 3]) -> [(usize, f32); 8] {
    let [(r, to_r), (g, to_g), (b, to_b)] = colour.map(place);
    let first = (r * CORNERS + g) * CORNERS + b;
    std::array::from_fn(|i| {
        let (dr, dg, db) = (i >> 2, i >> 1 & 1, i & 1);
        let share = |d: usize, to: f32| if d == 1 { to } else { 1.0 - to };
        let corner = first + (dr * CORNERS + dg) * CORNERS + db;
        (corner, share(dr, to_r) * share(dg, to_g) * share(db, to_b))
    })
}

/// The corner before a value, and how far it is on the way to the next.
#[inline(always)]
fn place(value: f32) -> (usize, f32) {
    let at = (value - LEAST).clamp(0.0, (CORNERS - 1) as f32);
    let corner = (at as usize).min(CORNERS - 2);
    (corner, at - corner as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three pixels of one colour and one of another, both at corners of the grid.
    const FOUR: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, -1.0, 1.0, 2.0, 2.0, 2.0, 2.0];

    #[test]
    fn rare_colours_weigh_more() {
        let close = |found: Vec<f32>, expected: [f32; 4]| {
            let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close, "{found:?} {expected:?}");
        };
        close(weights(&FOUR, 1, 0.0), [0.25; 4]);
        // Each of the two colours half of all.
        close(weights(&FOUR, 1, 1.0), [1.0 / 6.0, 1.0 / 6.0, 0.5, 1.0 / 6.0]);
        let (common, sum) = (3.0_f32.powf(-0.5), 3.0_f32.sqrt() + 1.0);
        close(weights(&FOUR, 1, 0.5), [common, common, 1.0, common].map(|w| w / sum));
    }

    #[test]
    fn a_change_much_smaller_than_a_cell_hardly_changes_weights() {
        let picture = |change: f32| -> Vec<f32> {
            (0..300)
                .map(|i| (i as f32 * 0.37).sin() + change * (i as f32 * 1.7).cos())
                .collect()
        };
        let (before, after) = (weights(&picture(0.0), 1, 0.2), weights(&picture(0.05), 1, 0.2));
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
        let found = weights(&odd, 1, 1.0);
        assert!(found.iter().all(|w| w.is_finite() && *w > 0.0), "{found:?}");
        assert!((found.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!(weights(&[], 0, 1.0).is_empty());
    }
}
