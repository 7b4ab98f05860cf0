//! What a decoder is trained on: distinct messages, their projected features, and noise like natural variation.
use std::collections::HashSet;

use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use rand_chacha::ChaCha20Rng;

use super::decoder::{Decoder, unit};
use super::projection::Projection;
use crate::error::{Error, Result};
use guardsplat_codeword::Message;

/// Noise vectors drawn once; each sample of each step takes one of them at random.
const NOISE_POOL: usize = 4096;

/// Messages with their projected text features.
pub(super) struct Samples {
    /// `[n][rank]`.
    pub features: Vec<f32>,
    /// `[n][bits]`, 0 or 1.
    pub targets: Vec<f32>,
    pub rank: usize,
    pub bits: usize,
}

/// `messages` messages to train on and up to `unseen` kept apart, at most a quarter of all there are; all distinct.
pub(super) fn distinct_messages(
    bits: usize,
    messages: usize,
    unseen: usize,
    rng: &mut ChaCha20Rng,
) -> Result<(Vec<Message>, Vec<Message>)> {
    let all = if bits < usize::BITS as usize {
        1_usize << bits
    } else {
        usize::MAX
    };
    let unseen = unseen.min(all / 4);
    let wanted = messages.saturating_add(unseen).min(all);
    let mut messages = Vec::new();
    if wanted.saturating_mul(2) >= all {
        // Drawing until every message came up would take long: shuffle them all instead. Here `all` is small.
        for value in 0..all {
            let value_bits: Vec<bool> = (0..bits).rev().map(|b| value >> b & 1 == 1).collect();
            messages.push(Message::from_bits(&value_bits)?);
        }
        shuffle(&mut messages, rng);
        messages.truncate(wanted);
    } else {
        let mut known = HashSet::new();
        while messages.len() < wanted {
            let message = Message::random(bits, rng)?;
            if known.insert(message) {
                messages.push(message);
            }
        }
    }
    let kept_apart = messages.split_off(wanted - unseen);
    Ok((messages, kept_apart))
}

pub(super) fn shuffle<T>(items: &mut [T], rng: &mut impl Rng) {
    for i in (1..items.len()).rev() {
        items.swap(i, (rng.next_u64() % (i as u64 + 1)) as usize); // bias below 2^-40, harmless here
    }
}

/// `NOISE_POOL` rows `strength * F g`, g standard normal (Box-Muller); empty when there is no noise.
pub(super) fn noise_pool(
    projection: &Projection,
    strength: f32,
    rng: &mut ChaCha20Rng,
    device: &Device,
) -> Result<Vec<f32>> {
    let k = projection.rank;
    if strength == 0.0 || projection.noise.iter().all(|&v| v == 0.0) {
        return Ok(Vec::new());
    }
    let mut normal = Vec::with_capacity(NOISE_POOL * k);
    while normal.len() < NOISE_POOL * k {
        let radius = (-2.0 * (1.0 - unit(rng)).ln()).sqrt() * strength;
        let angle = std::f32::consts::TAU * unit(rng);
        normal.extend([radius * angle.cos(), radius * angle.sin()]);
    }
    normal.truncate(NOISE_POOL * k);
    let device = device.clone().without_autodiff();
    let normal = Tensor::<2>::from_data(TensorData::new(normal, [NOISE_POOL, k]), &device);
    let factor = Tensor::<2>::from_data(TensorData::new(projection.noise.clone(), [k, k]), &device);
    read(normal.matmul(factor.transpose()))
}

fn read(tensor: Tensor<2>) -> Result<Vec<f32>> {
    tensor.try_into_vec_as::<f32>().map_err(|e| Error::Device {
        device: "decoder".into(),
        reason: e.to_string(),
    })
}

impl Samples {
    pub fn len(&self) -> usize {
        self.targets.len() / self.bits
    }

    /// Features `[b, rank]`, with a random row of the noise pool added to each, and targets `[b, bits]`.
    pub fn batch(
        &self,
        rows: &[usize],
        noise: Option<(&Vec<f32>, &mut ChaCha20Rng)>,
        device: &Device,
    ) -> (Tensor<2>, Tensor<2>) {
        let pick = |from: &[f32], width: usize| -> Vec<f32> {
            rows.iter()
                .flat_map(|&r| &from[r * width..(r + 1) * width])
                .copied()
                .collect()
        };
        let mut features = pick(&self.features, self.rank);
        if let Some((pool, rng)) = noise.filter(|(pool, _)| !pool.is_empty()) {
            for row in features.chunks_exact_mut(self.rank) {
                let at = rng.next_u32() as usize % NOISE_POOL * self.rank;
                row.iter_mut().zip(&pool[at..]).for_each(|(x, n)| *x += n);
            }
        }
        let targets = pick(&self.targets, self.bits);
        let tensor = |values, width| Tensor::from_data(TensorData::new(values, [rows.len(), width]), device);
        (tensor(features, self.rank), tensor(targets, self.bits))
    }

    /// As many samples as there are, in `order`, but the share of them that is read best gives way to the share that is read
    /// worst, which then is there twice. A sample is read as well as its worst bit.
    pub fn hardest_again(
        &self,
        decoder: &Decoder,
        order: &[usize],
        share: f32,
        noise: Option<(&Vec<f32>, &mut ChaCha20Rng)>,
        device: &Device,
    ) -> Result<Vec<usize>> {
        let rows: Vec<usize> = (0..self.len()).collect();
        let logits = read(decoder.forward(self.batch(&rows, noise, device).0))?;
        let signed = logits
            .iter()
            .zip(&self.targets)
            .map(|(logit, target)| logit * (2.0 * target - 1.0));
        let signed: Vec<f32> = signed.collect();
        let margins: Vec<f32> = signed
            .chunks_exact(self.bits)
            .map(|bits| bits.iter().copied().fold(f32::INFINITY, f32::min))
            .collect();
        let mut by_margin = rows;
        by_margin.sort_by(|a, b| margins[*a].total_cmp(&margins[*b]));
        let count = (share * 0.5 * self.len() as f32) as usize;
        let again = &by_margin[..count];
        let left_out: HashSet<usize> = by_margin[self.len() - count..].iter().copied().collect();
        Ok(order
            .iter()
            .filter(|row| !left_out.contains(row))
            .chain(again)
            .copied()
            .collect())
    }

    /// Share of right bits; `None` without samples.
    pub fn accuracy(
        &self,
        decoder: &Decoder,
        noise: Option<(&Vec<f32>, &mut ChaCha20Rng)>,
        device: &Device,
    ) -> Result<Option<f64>> {
        if self.len() == 0 {
            return Ok(None);
        }
        let rows: Vec<usize> = (0..self.len()).collect();
        let logits = read(decoder.forward(self.batch(&rows, noise, device).0))?;
        let right = logits
            .iter()
            .zip(&self.targets)
            .filter(|&(&logit, &target)| (logit > 0.0) == (target > 0.5));
        Ok(Some(right.count() as f64 / self.targets.len() as f64))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::decoder::{DecoderWeights, LayerWeights};
    use super::*;

    #[test]
    fn what_is_read_worst_comes_twice_and_the_best_not_at_all() {
        // The decoder reads each sample's own number, so the margins are these.
        let samples = Samples {
            features: vec![4.0, -1.0, 2.0, 0.5],
            targets: vec![1.0, 1.0, 1.0, 0.0],
            rank: 1,
            bits: 1,
        };
        let layer = LayerWeights {
            inputs: 1,
            outputs: 1,
            weight: vec![1.0],
            bias: vec![0.0],
        };
        let decoder = Decoder::new(&DecoderWeights { layers: vec![layer] }, &Device::flex());
        let again = |share| {
            let order = [3, 1, 0, 2];
            samples
                .hardest_again(&decoder, &order, share, None, &Device::flex())
                .unwrap()
        };
        assert_eq!(again(0.0), [3, 1, 0, 2]);
        assert_eq!(again(0.5), [3, 1, 2, 1]);
        assert_eq!(again(1.0), [3, 1, 1, 3]);
    }

    #[test]
    fn messages_are_distinct_and_the_unseen_ones_apart() {
        let mut rng = ChaCha20Rng::seed_from_u64(1);
        let counts = [
            (1, 2, 0),
            (2, 3, 1),
            (4, 12, 4),
            (9, 384, 128),
            (16, 512, 128),
            (75, 512, 128),
        ];
        for (bits, train, apart) in counts {
            let (seen, unseen) = distinct_messages(bits, 512, 128, &mut rng).unwrap();
            assert_eq!((seen.len(), unseen.len()), (train, apart), "{bits} bits");
            let all: HashSet<_> = seen.iter().chain(&unseen).collect();
            assert_eq!(all.len(), seen.len() + unseen.len());
        }
    }

    #[test]
    fn noise_has_the_covariance_that_was_asked_for() {
        let mut projection = Projection::identity(2);
        projection.noise = vec![2.0, 0.0, 1.0, 0.5]; // F F^T = [[4, 2], [2, 1.25]]
        let mut rng = ChaCha20Rng::seed_from_u64(2);
        let pool = noise_pool(&projection, 0.5, &mut rng, &Device::flex()).unwrap();
        let mean = |f: fn(&[f32]) -> f32| pool.chunks(2).map(f).sum::<f32>() / NOISE_POOL as f32;
        assert!(mean(|x| x[0]).abs() < 0.06 && mean(|x| x[1]).abs() < 0.06);
        let found = [mean(|x| x[0] * x[0]), mean(|x| x[0] * x[1]), mean(|x| x[1] * x[1])];
        for (found, expected) in found.into_iter().zip([1.0, 0.5, 0.3125]) {
            assert!((found - expected).abs() < 0.06 * expected, "{found} {expected}");
        }
        assert!(
            noise_pool(&projection, 0.0, &mut rng, &Device::flex())
                .unwrap()
                .is_empty()
        );
    }
}
