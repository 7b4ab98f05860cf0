//! The image tower's random filters: directions of colour, each with a frequency and a phase.
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

/// Side of a filter: one pixel of its scale. What a wider filter sees depends on how a surface lies in the picture, and
/// a scene cannot move that alike in all views.
pub(crate) const KERNEL: usize = 1;
/// Least and largest norm of a filter, for pictures of unit deviation: a change of colour by its inverse turns the sine
/// by a radian. With weaker filters, colours that differ from view to view and from scene to scene weigh more than
/// what a mark adds; with stronger ones, the shading of a surface from view to view turns the sine too far.
const NORM: [f32; 2] = [11.0, 23.0];

/// Filters `[count][3][KERNEL][KERNEL]` and phases `[count]`.
pub(crate) fn filters(count: usize, seed: u64) -> (Vec<f32>, Vec<f32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut weights = Vec::with_capacity(count * 3 * KERNEL * KERNEL);
    for _ in 0..count {
        let filter: Vec<f32> = (0..3 * KERNEL * KERNEL)
            .map(|_| (0..4).map(|_| rng.random_range(-1.0..1.0_f32)).sum()) // nearly normal
            .collect();
        let length = filter.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
        let norm = NORM[0] * (NORM[1] / NORM[0]).powf(rng.random());
        weights.extend(filter.iter().map(|v| norm * v / length));
    }
    let phases = (0..count).map(|_| rng.random_range(0.0..TAU)).collect();
    (weights, phases)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn norms_stay_within_their_limits_and_the_seed_decides() {
        let (weights, phases) = filters(50, 3);
        for filter in weights.chunks_exact(3 * KERNEL * KERNEL) {
            let norm = filter.iter().map(|v| v * v).sum::<f32>().sqrt();
            assert!((NORM[0] * 0.999..NORM[1] * 1.001).contains(&norm), "{norm}");
        }
        assert!(phases.iter().all(|p| (0.0..TAU).contains(p)));
        assert_eq!(filters(50, 3), (weights.clone(), phases));
        assert_ne!(filters(50, 4).0, weights);
    }
}
