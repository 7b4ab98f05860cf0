//! Training views read as pictures that people share: compressed, noisy, or with tones that were estimated a little wrongly.
//!
//! All of it is done at the size of training views, standing for what is left of it in pictures of five times the side
//! that are averaged down: it costs a few percent of a step, where distorting enlarged views costs several steps.
use burn::tensor::{Int, Tensor, TensorData};
use guardsplat_distortion::{ReducedJpeg, reduced_jpeg};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;
use crate::ground::with_ground;

/// How many views are read so, and how strongly they are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SharedViews {
    /// Share of the views of a step.
    pub share: f32,
    /// Qualities of JPEG, drawn alike on a logarithmic scale. Where nothing can be read any more there is nothing to
    /// learn: the weakest compression that takes a mark away should be left out.
    pub quality: [u8; 2],
}

impl SharedViews {
    /// None.
    pub const NONE: Self = Self {
        share: 0.0,
        quality: [30, 85],
    };

    pub(super) fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    pub(super) fn check(&self) -> Result<()> {
        within("shared_views.share", f64::from(self.share), 0.0, 1.0)?;
        let [low, high] = self.quality.map(f64::from);
        within("shared_views.quality", low, 1.0, high)?;
        within("shared_views.quality", high, low, 100.0)
    }
}

impl Default for SharedViews {
    fn default() -> Self {
        Self::NONE
    }
}

/// Largest deviation of noise: that of 0.12 in pictures of five times the side.
const NOISE: f32 = 0.024;
/// Largest error of an estimated brightness, and of the tint of a channel.
const TONE: f32 = 0.012;
const TINT: f32 = 0.006;

/// What happens to one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shared {
    Jpeg,
    Noise,
    Tone,
}

/// Half of what happens is compression.
const HAPPENS: [Shared; 4] = [Shared::Jpeg, Shared::Jpeg, Shared::Noise, Shared::Tone];

/// Pictures `[b, 3, h, w]` in [0, 1], a share of them as shared pictures are, at places drawn from `rng`; differentiable.
/// The ground stays where it is.
pub(super) fn shared(pictures: Tensor<4>, views: SharedViews, rng: &mut ChaCha8Rng) -> Tensor<4> {
    let count = pictures.dims()[0];
    let some = (views.share * count as f32).round() as usize;
    if some == 0 {
        return pictures;
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(rng);
    let kinds: Vec<Shared> = (0..some).map(|_| HAPPENS[rng.random_range(0..HAPPENS.len())]).collect();
    let of = |kind: Shared| {
        let chosen = order.iter().zip(&kinds).filter(move |(_, k)| **k == kind);
        chosen.map(|(place, _)| *place).collect::<Vec<_>>()
    };
    let groups = [
        of(Shared::Jpeg),
        of(Shared::Noise),
        of(Shared::Tone),
        order[some..].to_vec(),
    ];
    let mut parts = Vec::new();
    for (which, places) in groups.iter().enumerate().filter(|(_, places)| !places.is_empty()) {
        let before = pictures.clone().select(0, indices(places, &pictures));
        let after = match which {
            0 => compressed(before.clone(), views.quality, rng),
            1 => noisy(before.clone(), rng),
            2 => toned(before.clone(), rng),
            _ => before.clone(),
        };
        parts.push(match which {
            0..3 => with_ground(&before, after, &vec![true; places.len()]),
            _ => after,
        });
    }
    // Back in order: where each picture is among the parts.
    let mut back = vec![0; count];
    for (row, place) in groups.iter().flatten().enumerate() {
        back[*place] = row;
    }
    Tensor::cat(parts, 0).select(0, indices(&back, &pictures))
}

fn indices(places: &[usize], like: &Tensor<4>) -> Tensor<1, Int> {
    let places: Vec<i64> = places.iter().map(|place| *place as i64).collect();
    let count = places.len();
    Tensor::from_data(TensorData::new(places, [count]), &like.device())
}

fn compressed(pictures: Tensor<4>, quality: [u8; 2], rng: &mut ChaCha8Rng) -> Tensor<4> {
    let [low, high] = quality.map(f32::from);
    let each: Vec<ReducedJpeg> = (0..pictures.dims()[0])
        .map(|_| ReducedJpeg {
            quality: (low * (high / low).powf(rng.random::<f32>())) as u8,
        })
        .collect();
    let offset = [rng.random_range(0..4), rng.random_range(0..4)];
    reduced_jpeg(pictures, &each, offset)
}

/// The numbers are drawn on the host, because no two devices draw the same.
fn noisy(pictures: Tensor<4>, rng: &mut ChaCha8Rng) -> Tensor<4> {
    let dims @ [count, channels, h, w] = pictures.dims();
    let mut values = Vec::with_capacity(count * channels * h * w);
    for _ in 0..count {
        let sigma = NOISE * rng.random::<f32>();
        values.extend((0..channels * h * w).map(|_| sigma * normal(rng)));
    }
    let noise = Tensor::<4>::from_data(TensorData::new(values, dims), &pictures.device());
    (pictures + noise).clamp(0.0, 1.0)
}

/// Nearly normal, of unit deviation: the sum of four uniform numbers, whose variance is a third.
fn normal(rng: &mut ChaCha8Rng) -> f32 {
    3.0_f32.sqrt() * ((0..4).map(|_| rng.random::<f32>()).sum::<f32>() - 2.0)
}

fn toned(pictures: Tensor<4>, rng: &mut ChaCha8Rng) -> Tensor<4> {
    let count = pictures.dims()[0];
    let mut off = |most: f32| most * (2.0 * rng.random::<f32>() - 1.0);
    let factors: Vec<f32> = (0..count)
        .flat_map(|_| {
            let all = 1.0 + off(TONE);
            [off(TINT), off(TINT), off(TINT)].map(|tint| all + tint)
        })
        .collect();
    let factors = Tensor::<4>::from_data(TensorData::new(factors, [count, 3, 1, 1]), &pictures.device());
    (pictures * factors).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use rand::SeedableRng;

    use super::*;

    /// Eight pictures, each of one level of grey and a white column.
    fn pictures() -> Tensor<4> {
        let value = |i: usize| {
            if i % 16 == 0 {
                1.0
            } else {
                0.2 + 0.07 * (i / (3 * 256)) as f32
            }
        };
        let values: Vec<f32> = (0..8 * 3 * 256).map(value).collect();
        Tensor::from_data(TensorData::new(values, [8, 3, 16, 16]), &Device::flex())
    }

    fn views(share: f32) -> SharedViews {
        SharedViews {
            share,
            quality: [10, 70],
        }
    }

    fn read(tensor: Tensor<4>) -> Vec<f32> {
        tensor.try_into_vec_as::<f32>().unwrap()
    }

    #[test]
    fn a_share_changes_a_little_and_pictures_keep_their_places_and_ground() {
        let before = read(pictures());
        for (share, most) in [(0.0, 0), (0.5, 4), (1.0, 8)] {
            let mut changed = 0;
            for seed in 0..6 {
                let after = read(shared(pictures(), views(share), &mut ChaCha8Rng::seed_from_u64(seed)));
                let rows = before.chunks_exact(3 * 256).zip(after.chunks_exact(3 * 256));
                let differ = rows.filter(|(b, a)| b != a).count();
                assert!(differ <= most, "{share}");
                changed += differ;
                for (b, a) in before.iter().zip(&after) {
                    assert!(
                        if *b == 1.0 { a == b } else { (a - b).abs() < 0.16 },
                        "{share}: {b} {a}"
                    );
                }
            }
            assert!(changed >= most * 3, "{share}: {changed}");
        }
    }

    #[test]
    fn one_seed_does_the_same_and_gradients_pass() {
        let run = |seed| read(shared(pictures(), views(0.5), &mut ChaCha8Rng::seed_from_u64(seed)));
        assert_eq!(run(1), run(1));
        assert_ne!(run(1), run(2));
        let device = Device::flex().autodiff();
        let leaf = Tensor::from_inner(pictures()).to_device(&device).require_grad();
        let done = shared(leaf.clone(), views(1.0), &mut ChaCha8Rng::seed_from_u64(4));
        let gradient: Vec<f32> = leaf.grad(&done.sum().backward()).unwrap().try_into_vec_as().unwrap();
        assert!(gradient.iter().all(|g| (g - 1.0).abs() < 0.05), "{gradient:?}");
    }
}
