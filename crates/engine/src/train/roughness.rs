//! Makes sample scenes as rough as captured ones are.
//!
//! Samples are clean: opaque Gaussians, a texture that is alike from all sides but for a highlight. Captured scenes
//! paint what they do not know into view-dependent colours, differ from one Gaussian to the next, and see through many
//! of them, so that one surface has other colours in every view. A head that was fitted to clean scenes prefers
//! directions that nothing is left of there. Each scene is rough in three ways, each as strongly as is drawn for it.
use crate::scene::Gaussians;
use rand::{Rng, RngExt};

/// Largest standard deviation of coefficients that are not constant: of all channels together, and of each channel.
/// `playbot_31k.ply` has about two thirds of it (docs/clip.md, "Lightness is what varies with the view").
const VIEWS: [f32; 2] = [0.24, 0.09];
/// The same of constant coefficients.
const GRAIN: [f32; 2] = [0.7, 0.28];
/// Share of scenes that can be seen through.
const VEILED: f32 = 0.6;
/// Logits of opacity there.
const OPACITY_LOGITS: [f32; 2] = [-2.0, 4.0];

/// Degrees of spherical harmonics that scenes have in turn: users' have 3, or none.
const DEGREES: [usize; 4] = [3, 0, 3, 2];

/// The degree of the scene with this index.
pub(super) fn degree(index: u64) -> usize {
    DEGREES[(index % DEGREES.len() as u64) as usize]
}

/// Roughens a scene; `limit` multiplies the largest deviations.
pub(super) fn roughen(gaussians: &mut Gaussians, limit: f32, rng: &mut impl Rng) {
    let [views, grain, veil]: [f32; 3] = rng.random();
    let [views, grain] = [limit * views, limit * grain];
    let stride = gaussians.sh.per_gaussian();
    for row in gaussians.sh.coefficients.chunks_exact_mut(stride) {
        for (k, coefficient) in row.chunks_exact_mut(3).enumerate() {
            let [common, own] = match k {
                0 => GRAIN.map(|deviation| grain * deviation),
                _ => VIEWS.map(|deviation| views * deviation),
            };
            let common = common * normal(rng);
            coefficient.iter_mut().for_each(|c| *c += common + own * normal(rng));
        }
    }
    if veil < VEILED {
        let [low, high] = OPACITY_LOGITS;
        gaussians
            .opacity_logits
            .iter_mut()
            .for_each(|logit| *logit = rng.random_range(low..high));
    }
}

/// Nearly normal, of unit deviation: the sum of four uniform numbers, whose variance is a third.
fn normal(rng: &mut impl Rng) -> f32 {
    3.0_f32.sqrt() * ((0..4).map(|_| rng.random::<f32>()).sum::<f32>() - 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::sample;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Variance of what was added to constant and to other coefficients.
    fn added(seed: u64) -> ([f64; 2], bool) {
        let clean = sample(2000, 3, 5).unwrap().gaussians;
        let mut rough = sample(2000, 3, 5).unwrap().gaussians;
        roughen(&mut rough, 1.0, &mut ChaCha8Rng::seed_from_u64(seed));
        let mut sums = [(0.0, 0.0); 2];
        let pairs = clean.sh.coefficients.iter().zip(&rough.sh.coefficients);
        for (i, (before, after)) in pairs.enumerate() {
            let (sum, count) = &mut sums[usize::from(i % clean.sh.per_gaussian() >= 3)];
            *sum += f64::from(after - before).powi(2);
            *count += 1.0;
        }
        let veiled = clean.opacity_logits != rough.opacity_logits;
        (sums.map(|(sum, count)| sum / count), veiled)
    }

    #[test]
    fn scenes_differ_in_roughness_and_none_is_rougher_than_the_limits() {
        let found: Vec<_> = (0..12).map(added).collect();
        for (which, [common, own]) in [GRAIN, VIEWS].into_iter().enumerate() {
            let most = f64::from(common.powi(2) + own.powi(2));
            let of = |(variances, _): &([f64; 2], bool)| variances[which];
            assert!(found.iter().all(|f| of(f) < 1.1 * most));
            let mean = found.iter().map(of).sum::<f64>() / 12.0;
            assert!((0.1..0.6).contains(&(mean / most)), "{which}: {mean} of {most}");
        }
        let veiled = found.iter().filter(|(_, veiled)| *veiled).count();
        assert!((3..12).contains(&veiled), "{veiled}");
    }

    #[test]
    fn one_seed_roughens_alike() {
        assert_eq!(added(4), added(4));
        assert_ne!(added(4).0, added(5).0);
    }
}
