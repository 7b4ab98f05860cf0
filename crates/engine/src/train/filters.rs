//! The image tower's random filters: directions of colour, each with a frequency and a phase, to which black and white
//! are nothing.
use crate::clip::config::Normalization;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

/// Side of a filter: one pixel of its scale. What a wider filter sees depends on how a surface lies in the picture, and
/// a scene cannot move that alike in all views.
pub(crate) const KERNEL: usize = 1;
/// Least and largest norm of a filter, for pictures of unit deviation: a change of colour by its inverse turns the sine
/// by a radian. With weaker filters, colours that differ from view to view and from scene to scene weigh more than
/// what a mark adds, above all on smooth surfaces; with stronger ones, the shading of a surface and the mixture of
/// colours in a pixel turn the sine too far from view to view.
pub(crate) const NORM: [f32; 2] = [17.0, 34.0];

/// Share of a filter's direction that is lightness, against what a random direction has. Shading and highlights turn
/// lightness from view to view two to five times as far as the other two axes of colour, so that of what a mark does to
/// lightness less is left in other views. Without any, greys would be nothing whatever the scene, and flat colours weigh
/// more.
pub(crate) const LUMA: f32 = 0.3;

/// Filters `[count][3][KERNEL][KERNEL]` and phases `[count]`. From black to white a filter makes whole turns, and its
/// phase makes black 0, so that a ground of either adds nothing to an average, however much of it is seen.
pub(crate) fn filters(count: usize, norm: [f32; 2], luma: f32, seed: u64) -> (Vec<f32>, Vec<f32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let Normalization { mean, std } = Normalization::default();
    let black_to_white = std.map(f32::recip);
    let squares: f32 = black_to_white.iter().map(|v| v * v).sum();
    let mut weights = Vec::with_capacity(count * 3 * KERNEL * KERNEL);
    let mut phases = Vec::with_capacity(count);
    for _ in 0..count {
        let direction: [f32; 3] = std::array::from_fn(|_| (0..4).map(|_| rng.random_range(-1.0..1.0_f32)).sum()); // nearly normal
        let grey = (1.0 - luma) * dot(&direction, &black_to_white) / squares;
        let direction: [f32; 3] = std::array::from_fn(|c| direction[c] - grey * black_to_white[c]);
        let length = direction.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
        let norm = norm[0] * (norm[1] / norm[0]).powf(rng.random());
        let wave = direction.map(|v| norm * v / length);
        let angle = dot(&wave, &black_to_white);
        let change = ((angle / TAU).round() * TAU - angle) / squares;
        let wave: [f32; 3] = std::array::from_fn(|c| wave[c] + change * black_to_white[c]);
        let black: [f32; 3] = std::array::from_fn(|c| -mean[c] / std[c]);
        phases.push((-dot(&wave, &black)).rem_euclid(TAU));
        weights.extend(wave);
    }
    (weights, phases)
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn norms_stay_near_their_limits_and_the_seed_decides() {
        let (weights, phases) = filters(50, NORM, LUMA, 3);
        for filter in weights.chunks_exact(3) {
            let norm = filter.iter().map(|v| v * v).sum::<f32>().sqrt();
            // Whole turns from black to white move a filter by less than half a turn over their distance.
            assert!((NORM[0] - 0.5..NORM[1] + 0.5).contains(&norm), "{norm}");
        }
        assert_eq!(filters(50, NORM, LUMA, 3), (weights.clone(), phases));
        assert_ne!(filters(50, NORM, LUMA, 4).0, weights);
    }

    #[test]
    fn black_and_white_are_nothing() {
        let (weights, phases) = filters(50, NORM, LUMA, 3);
        let Normalization { mean, std } = Normalization::default();
        for (wave, phase) in weights.as_chunks::<3>().0.iter().zip(phases) {
            for level in [0.0, 1.0] {
                let colour = std::array::from_fn(|c| (level - mean[c]) / std[c]);
                let response = (dot(wave, &colour) + phase).sin();
                assert!(response.abs() < 1e-4, "{level}: {response}");
            }
        }
    }
}
