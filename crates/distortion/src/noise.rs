//! Normal noise on each value.
use burn::tensor::{Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::groups::one_each;

/// Noise of one picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Standard deviation; pictures are in [0, 1].
    pub sigma: f32,
    /// Seed of the picture's noise.
    pub seed: u64,
}

/// Adds noise to pictures `[b, 3, h, w]`, each by its own seed, and clamps to [0, 1].
///
/// The numbers are drawn on the host, because no two devices draw the same.
pub(crate) fn noise(pictures: Tensor<4>, each: &[Noise]) -> Tensor<4> {
    let [b, c, h, w] = pictures.dims();
    let device = pictures.device();
    let mut values = Vec::with_capacity(b * c * h * w);
    for Noise { seed, .. } in each {
        let rng = ChaCha8Rng::seed_from_u64(*seed);
        values.extend(Distribution::<f32>::sample_iter(StandardNormal, rng).take(c * h * w));
    }
    let noise = Tensor::<4>::from_data(TensorData::new(values, [b, c, h, w]), &device);
    let sigmas = one_each(each.iter().map(|n| n.sigma), &device);
    (pictures + noise * sigmas).clamp(0.0, 1.0)
}
