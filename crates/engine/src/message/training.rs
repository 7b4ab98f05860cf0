//! Trains the decoder on text features of fresh random messages, and measures it on messages it never saw.
use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::Device;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha20Rng;

use super::decoder::{Decoder, DecoderWeights, bce_from_logits};
use super::linear;
use super::projection::Projection;
use super::samples::{Samples, distinct_messages, noise_pool, shuffle};
use super::tokens::{CONTEXT, TokenTable};
use crate::error::{Error, Result};
use crate::stop::Stop;
use guardsplat_codeword::Message;

/// Sequences given to the text tower at once.
const ENCODE_BATCH: usize = 64;

/// What kind of decoder reads messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DecoderKind {
    /// The perceptron of the published method, trained by gradient descent.
    #[default]
    Perceptron,
    /// A linear map in closed form.
    Linear,
}

/// How to train a decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingOptions {
    /// Its kind; a linear one has no use for batches, epochs, rate and noise.
    pub kind: DecoderKind,
    /// Distinct messages to train on (fewer where the length has fewer).
    pub messages: usize,
    /// Messages kept apart to measure on, at most a quarter of all that the length has.
    pub unseen: usize,
    /// Messages a step.
    pub batch: usize,
    /// Passes over the training messages; `None` takes 24, 36 or 48 for up to 16, 48 or more bits.
    pub epochs: Option<usize>,
    /// Adam's rate at the start; it falls to zero along a half cosine.
    pub learning_rate: f64,
    /// Natural variation added to the features: times what unmarked pictures show (the projection's noise).
    pub noise: f32,
    /// Share of each epoch after the first, 0 to 1, that is made of the messages that are read worst and their repetition, in
    /// place of those that are read best; 0 has every message once an epoch.
    pub hard: f32,
    /// Decides messages, initial weights, order and noise.
    pub seed: u64,
}

impl std::str::FromStr for DecoderKind {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "linear" => Ok(Self::Linear),
            "perceptron" => Ok(Self::Perceptron),
            other => Err(Error::BadOption {
                field: "decoder",
                reason: format!("{other:?} is not a decoder, must be linear or perceptron"),
            }),
        }
    }
}

impl Default for TrainingOptions {
    fn default() -> Self {
        Self {
            kind: DecoderKind::default(),
            messages: 2048,
            unseen: 256,
            batch: 64,
            epochs: None,
            learning_rate: 5e-3,
            noise: 0.5,
            hard: 0.0,
            seed: 0,
        }
    }
}

/// A trained decoder and how well it reads text features.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The weights.
    pub weights: DecoderWeights,
    /// Share of right bits on the training messages, without noise.
    pub accuracy_seen: f64,
    /// Share of right bits on unseen messages, without noise; `None` where the length has too few messages.
    pub accuracy_unseen: Option<f64>,
    /// As `accuracy_unseen`, under the noise of the training.
    pub accuracy_unseen_noisy: Option<f64>,
    /// Optimiser steps taken.
    pub steps: usize,
}

/// What training is doing, for a progress display: the stage, steps done, steps in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Messages passed through the text tower.
    Encoding(usize, usize),
    /// Optimiser steps.
    Training(usize, usize),
}

/// Trains a decoder for the messages of `table` behind `projection` on `device`.
///
/// `encode` is the text tower: token sequences to L2-normalised features, `[n][projection.width]` row-major; it is
/// called with at most 64 sequences at a time. On the CPU the same seed gives the same weights.
///
/// # Errors
/// Those of `encode`, features of another size or not finite, a loss that stops being a number, and [`Error::Stopped`].
pub fn train(
    table: &TokenTable,
    projection: &Projection,
    mut encode: impl FnMut(&[[i64; CONTEXT]]) -> Result<Vec<f32>>,
    options: &TrainingOptions,
    device: &Device,
    stop: &Stop,
    mut progress: impl FnMut(Progress),
) -> Result<Trained> {
    check(options)?;
    let bits = table.bits();
    let mut rng = ChaCha20Rng::seed_from_u64(options.seed);
    let (seen, unseen) = distinct_messages(bits, options.messages, options.unseen, &mut rng)?;
    let total = seen.len() + unseen.len();
    let mut encoded = 0;
    let mut sample = |messages: &[Message]| -> Result<Samples> {
        let mut features = Vec::with_capacity(messages.len() * projection.rank);
        for chunk in messages.chunks(ENCODE_BATCH) {
            let sequences = chunk.iter().map(|m| table.sequence(m)).collect::<Result<Vec<_>>>()?;
            let raw = encode(&sequences)?;
            check_features(&raw, chunk.len() * projection.width)?;
            features.extend(projection.project_text(&raw));
            encoded += chunk.len();
            progress(Progress::Encoding(encoded, total));
        }
        let targets = messages.iter().flat_map(Message::targets).collect();
        Ok(Samples {
            features,
            targets,
            rank: projection.rank,
            bits,
        })
    };
    let (seen, unseen) = (sample(&seen)?, sample(&unseen)?);
    let noise = noise_pool(projection, options.noise, &mut rng, device)?;

    let (decoder, steps) = match options.kind {
        DecoderKind::Linear => (linear_decoder(&seen, device)?, 0),
        DecoderKind::Perceptron => perceptron(&seen, &noise, options, &mut rng, device, stop, &mut progress)?,
    };
    let weights = decoder.weights()?;
    if weights.check().is_err() {
        return Err(Error::NotFinite {
            step: steps,
            term: "decoder",
            value: f32::NAN,
        });
    }
    let device = device.clone().without_autodiff();
    Ok(Trained {
        accuracy_seen: seen.accuracy(&decoder, None, &device)?.unwrap_or(0.0),
        accuracy_unseen: unseen.accuracy(&decoder, None, &device)?,
        accuracy_unseen_noisy: unseen.accuracy(&decoder, Some((&noise, &mut rng)), &device)?,
        weights,
        steps,
    })
}

fn linear_decoder(seen: &Samples, device: &Device) -> Result<Decoder> {
    let weights = linear::fit(seen).ok_or_else(|| Error::BadModel {
        name: "text tower".into(),
        reason: "its features do not tell messages apart".into(),
    })?;
    Ok(Decoder::new(&weights, &device.clone().without_autodiff()))
}

/// Trains the perceptron; also says in how many steps.
fn perceptron(
    seen: &Samples,
    noise: &Vec<f32>,
    options: &TrainingOptions,
    rng: &mut ChaCha20Rng,
    device: &Device,
    stop: &Stop,
    progress: &mut impl FnMut(Progress),
) -> Result<(Decoder, usize)> {
    let bits = seen.bits;
    let tracking = device.clone().without_autodiff().autodiff();
    let mut decoder = Decoder::new(&DecoderWeights::seeded(seen.rank, bits, rng.next_u64()), &tracking);
    let mut optimizer = AdamConfig::new().with_epsilon(1e-8).init();
    let mut order: Vec<usize> = (0..seen.len()).collect();
    let epochs = options.epochs.unwrap_or(match bits {
        0..=16 => 24,
        17..=48 => 36,
        _ => 48,
    });
    let steps = epochs * seen.len().div_ceil(options.batch);
    let mut step = 0;
    for epoch in 0..epochs {
        shuffle(&mut order, rng);
        if options.hard > 0.0 && epoch > 0 {
            let plain = device.clone().without_autodiff();
            let all = (0..seen.len()).collect::<Vec<_>>();
            let noise = Some((noise, &mut *rng));
            order = seen.hardest_again(&decoder.valid(), &all, options.hard, noise, &plain)?;
            shuffle(&mut order, rng);
        }
        for rows in order.chunks(options.batch) {
            stop.check()?;
            let (features, targets) = seen.batch(rows, Some((noise, &mut *rng)), &tracking);
            let loss = bce_from_logits(decoder.forward(features), targets);
            if step % 64 == 0 {
                finite(step, loss.clone().into_scalar::<f32>())?;
                progress(Progress::Training(step, steps));
            }
            let gradients = GradientsParams::from_grads(loss.backward(), &decoder);
            let rate = options.learning_rate * 0.5 * (1.0 + (std::f64::consts::PI * step as f64 / steps as f64).cos());
            decoder = optimizer.step(rate, decoder, gradients);
            step += 1;
        }
    }
    progress(Progress::Training(steps, steps));

    Ok((decoder.valid(), steps))
}

fn check(options: &TrainingOptions) -> Result<()> {
    let bad = |field, reason: &str| {
        Err(Error::BadOption {
            field,
            reason: reason.into(),
        })
    };
    if options.messages == 0 || options.batch == 0 || options.epochs == Some(0) {
        return bad("training", "messages, batch and epochs must be at least 1");
    }
    if !(options.noise >= 0.0 && options.noise.is_finite()) {
        return bad("noise", "must be zero or a positive number");
    }
    if !(0.0..=1.0).contains(&options.hard) {
        return bad("hard", "must be a share of 0 to 1");
    }
    if !(options.learning_rate > 0.0 && options.learning_rate.is_finite()) {
        return bad("learning rate", "must be a positive number");
    }
    Ok(())
}

fn check_features(features: &[f32], expected: usize) -> Result<()> {
    let reason = if features.len() != expected {
        format!("{} numbers, not {expected}", features.len())
    } else if let Some(v) = features.iter().find(|v| !v.is_finite()) {
        format!("a feature is {v}")
    } else {
        return Ok(());
    };
    Err(Error::BadModel {
        name: "text tower".into(),
        reason,
    })
}

fn finite(step: usize, value: f32) -> Result<()> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(Error::NotFinite {
            step,
            term: "decoder",
            value,
        })
    }
}

#[cfg(test)]
mod tests;
