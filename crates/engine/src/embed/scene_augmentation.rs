//! Augmentation of the scene that a training view shows: the changes of scenes that a mark is to stand.
//!
//! The unmarked picture that the view is compared with shows the same: only the mark is to differ. What files of other
//! formats round away is noise here, of the deviation that their steps have.
use guardsplat_distortion::{DistortionKind, RobustTo};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::splat::{Geometry, PreparedView};
use crate::view::vector::{dot, sub};

/// Largest deviation of noise on coefficients that a mark is to stand; smaller ones are drawn too.
const NOISE: f32 = 0.1;
/// Share of Gaussians that are left out.
const PRUNED: f32 = 0.25;
/// Standard deviations that rounding to 8 bits (constant coefficients, over 1 / 0.15 of their unit) and to 5 and 4 bits
/// (all others, over two units) leaves in SPZ: a step over the root of 12.
const SPZ: [f32; 2] = [1.0 / (255.0 * 0.15) / 3.464, 0.018];
/// As of SPZ, for SOG: 256 levels for constant coefficients, and a palette for the others. Of the size of SPZ's; how far a
/// palette is off depends on the scene, and was not measured.
const SOG: [f32; 2] = [0.005, 0.03];
/// The square of the constant spherical harmonic: with (n + 1)^2 of these, the mean square of all up to degree n.
const MEAN_SQUARE: f32 = 0.079_577_47;

/// What happens to the scene of one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SceneAugmentation {
    /// Nothing.
    None,
    /// Bands above this degree are dropped.
    TruncateSh(usize),
    /// Normal noise of these deviations on constant and on all other coefficients.
    Noise { dc: f32, rest: f32, seed: u64 },
    /// A share of the Gaussians is left out, at random.
    Prune { share: f32, seed: u64 },
    /// What lies farther than a radius from a centre is left out, world units.
    CutOut { centre: [f32; 3], radius: f32 },
}

impl SceneAugmentation {
    /// One of nothing and what of `robust_to` happens to scenes, all equally likely; always the same for an index.
    pub fn draw(robust_to: RobustTo, degree: usize, seed: u64, index: u64) -> Self {
        let kinds: Vec<DistortionKind> = robust_to.of_scenes().collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(2));
        rng.set_stream(index);
        let choice = rng.random_range(0..=kinds.len());
        let seed = rng.random();
        let noise = |[dc, rest]: [f32; 2]| Self::Noise { dc, rest, seed };
        match choice.checked_sub(1).and_then(|i| kinds.get(i)) {
            Some(DistortionKind::ShTruncation) => Self::TruncateSh(rng.random_range(0..=degree)),
            Some(DistortionKind::ShNoise) => noise([NOISE * rng.random::<f32>(); 2]),
            Some(DistortionKind::Spz) => noise(SPZ),
            Some(DistortionKind::Sog) => noise(SOG),
            Some(DistortionKind::Pruning) => Self::Prune { share: PRUNED, seed },
            _ => Self::None,
        }
    }

    /// The scene without the Gaussians that are left out, where there are any; rows stay what they were.
    pub fn pruned<'a>(self, geometry: &Geometry<'a>) -> Option<Geometry<'a>> {
        match self {
            Self::Prune { share, seed } => {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                Some(geometry.without(|_| rng.random::<f32>() < share))
            }
            Self::CutOut { centre, radius } => Some(geometry.without(|position| {
                let from_centre = sub(position, centre);
                dot(from_centre, from_centre) > radius * radius
            })),
            _ => None,
        }
    }

    /// What is added to the colours of the visible Gaussians of a view, `[visible][3]`; empty for nothing. Noise of the
    /// coefficients is one number for each direction, which its view looks along.
    pub fn noise(self, view: &PreparedView, degree: usize) -> Vec<f32> {
        let Self::Noise { dc, rest, seed } = self else {
            return Vec::new();
        };
        let bands = ((degree + 1) * (degree + 1)) as f32 - 1.0;
        let sigma = (MEAN_SQUARE * (dc * dc + bands * rest * rest)).sqrt();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = |_| sigma * rng.sample::<f32, _>(StandardNormal);
        (0..3 * view.visible.len()).map(normal).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::sample;
    use crate::splat::WeightCache;
    use crate::view::{Split, ViewSampler};

    #[test]
    fn nothing_is_altered_unless_asked_for_and_all_kinds_are_drawn_alike() {
        let none = (0..50).map(|i| SceneAugmentation::draw(RobustTo::none(), 3, 1, i));
        assert!(none.into_iter().all(|a| a == SceneAugmentation::None));
        // Those of pictures leave the scene alone.
        let pictures = "jpeg,crop".parse().unwrap();
        assert_eq!(SceneAugmentation::draw(pictures, 3, 1, 7), SceneAugmentation::None);
        let all: Vec<SceneAugmentation> = (0..600)
            .map(|i| SceneAugmentation::draw(RobustTo::all(), 3, 1, i))
            .collect();
        let share = |is: fn(&SceneAugmentation) -> bool| all.iter().filter(|a| is(a)).count() as f64 / 600.0;
        assert!((share(|a| *a == SceneAugmentation::None) - 1.0 / 6.0).abs() < 0.05);
        assert!((share(|a| matches!(a, SceneAugmentation::TruncateSh(_))) - 1.0 / 6.0).abs() < 0.05);
        assert!((share(|a| matches!(a, SceneAugmentation::Noise { .. })) - 0.5).abs() < 0.07);
        assert!((share(|a| matches!(a, SceneAugmentation::Prune { .. })) - 1.0 / 6.0).abs() < 0.05);
        for degree in 0..4 {
            assert!(all.contains(&SceneAugmentation::TruncateSh(degree)));
        }
    }

    #[test]
    fn a_quarter_is_left_out_and_noise_has_its_deviation() {
        let scene = sample(4000, 2, 3).unwrap().gaussians;
        let camera = ViewSampler::new(&scene, 1).unwrap().camera(Split::Training, 0, 48);
        let geometry = Geometry::new(&scene);
        let view = geometry.prepare(&camera, WeightCache::None).unwrap();
        let pruning = SceneAugmentation::Prune { share: 0.25, seed: 5 };
        let pruned = pruning.pruned(&geometry).unwrap();
        let left = pruned.prepare(&camera, WeightCache::None).unwrap().visible.len();
        let share = left as f64 / view.visible.len() as f64;
        assert!((share - 0.75).abs() < 0.05, "{share}");
        assert!(pruning.noise(&view, 2).is_empty() && SceneAugmentation::None.pruned(&geometry).is_none());

        let noise = SceneAugmentation::Noise {
            dc: 0.1,
            rest: 0.1,
            seed: 1,
        }
        .noise(&view, 2);
        assert_eq!(noise.len(), 3 * view.visible.len());
        let square = noise.iter().map(|n| f64::from(n * n)).sum::<f64>() / noise.len() as f64;
        // Nine coefficients of deviation 0.1 along a direction: their mean square is 9 / (4 pi) of 0.01.
        let expected = 0.01 * 9.0 / (4.0 * std::f64::consts::PI);
        assert!((square / expected - 1.0).abs() < 0.1, "{square} {expected}");
    }
}
