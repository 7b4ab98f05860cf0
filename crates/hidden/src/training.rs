//! Joint training of encoder and decoder, as in HiDDeN (Zhu et al. 2018, arXiv 1807.09937), with a residual of fixed
//! strength in place of a loss for it.
use burn::module::Module;
use burn::tensor::activation::softplus;
use burn::tensor::{Device, Tensor, TensorData};
use guardsplat_distortion::Layer;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::adam::Adam;
use crate::decoder::Decoder;
use crate::encoder::Encoder;
use crate::error::{Error, Result, host, within};
use crate::geometry::Geometry;
use crate::weights::Weights;

/// How often progress is reported, in steps.
const REPORT: usize = 20;

/// How to train a decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Bits of a message, 1 to [`crate::MAX_BITS`].
    pub bits: usize,
    /// Optimiser steps, 1 to 1,000,000.
    pub steps: usize,
    /// Pictures a step, 1 to 256.
    pub batch: usize,
    /// Adam's rate after the first steps; it falls to zero along a half cosine.
    pub learning_rate: f64,
    /// Strength of the residual at the start, until messages are read, as a PSNR in dB before the sum is clamped.
    pub start_psnr: f32,
    /// Strength at the end.
    pub end_psnr: f32,
    /// How pictures are turned, zoomed and moved before they are read.
    pub geometry: Geometry,
    /// What else happens to them then; nothing by default.
    pub distortions: Layer,
    /// Decides weights, messages and changes of pictures.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            bits: 32,
            steps: 1500,
            batch: 8,
            learning_rate: 2e-3,
            start_psnr: 26.0,
            end_psnr: 37.0,
            geometry: Geometry::default(),
            distortions: Layer::default(),
            seed: 0,
        }
    }
}

impl Options {
    fn check(&self) -> Result<()> {
        within("steps", self.steps as f64, 1.0, 1e6)?;
        within("batch", self.batch as f64, 1.0, 256.0)?;
        within("learning rate", self.learning_rate, 1e-9, 1.0)?;
        within("start psnr", self.start_psnr.into(), 10.0, 60.0)?;
        within("end psnr", self.end_psnr.into(), 10.0, 60.0)?;
        self.geometry.check()?;
        Ok(self.distortions.check()?)
    }

    /// Strength (dB) and part of the geometry when `done` (0 to 1) of the way from easy to hard pictures is gone: first the
    /// geometry widens, then the mark weakens. Both at once undo what was learned.
    fn stage(&self, done: f32) -> (f32, f32) {
        let part = (2.0 * done - 1.0).clamp(0.0, 1.0);
        let geometry = (2.0 * done).clamp(0.0, 1.0);
        (self.start_psnr + (self.end_psnr - self.start_psnr) * part, geometry)
    }

    /// Adam's rate at `step`.
    fn rate(&self, step: usize) -> f64 {
        let warm = ((step + 1) as f64 / 50.0).min(1.0);
        let done = step as f64 / self.steps as f64;
        self.learning_rate * warm * 0.5 * (1.0 + (std::f64::consts::PI * done).cos())
    }
}

/// How far pictures have become harder: a step further whenever messages are read, and only then. Harder pictures before
/// that are never learned from.
struct Curriculum {
    loss: f32,
    done: f32,
}

impl Curriculum {
    /// Cross entropy in nats a bit below which messages count as read, and how fast its mean follows.
    const READ: f32 = 0.25;
    const DECAY: f32 = 0.9;
    /// Share of all steps that the way takes, if there is no waiting.
    const SHARE: f32 = 0.5;

    fn new() -> Self {
        Self {
            loss: std::f32::consts::LN_2,
            done: 0.0,
        }
    }

    fn step(&mut self, loss: f32, steps: usize) {
        self.loss = Self::DECAY * self.loss + (1.0 - Self::DECAY) * loss;
        if self.loss < Self::READ {
            self.done = (self.done + 1.0 / (Self::SHARE * steps as f32)).min(1.0);
        }
    }
}

/// What training is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Steps taken.
    pub step: usize,
    /// Steps in all.
    pub steps: usize,
    /// Binary cross entropy of the last step, in nats a bit.
    pub loss: f32,
    /// Strength of the residual in that step, in dB.
    pub psnr: f32,
}

/// A trained pair; only the decoder's weights are for keeping, the encoder serves to measure them.
#[derive(Debug)]
pub struct Trained {
    /// The decoder's weights.
    pub weights: Weights,
    pub(crate) encoder: Encoder,
    pub(crate) device: Device,
}

/// Trains a decoder on pictures from `pictures`, which is asked for `[count, 3, h, w]` in [0, 1] with even sides of at
/// least 32 pixels at each step, with fresh random messages. `stop` is asked before each step. On the CPU the same seed
/// and the same pictures give the same weights.
///
/// # Errors
/// [`Error::OutOfRange`] for options outside their limits, those of `pictures`, [`Error::BadShape`] for other pictures,
/// [`Error::NotFinite`] when the loss stops being a number, [`Error::Stopped`].
pub fn train(
    options: &Options,
    device: &Device,
    mut pictures: impl FnMut(usize) -> Result<Tensor<4>>,
    mut progress: impl FnMut(Progress),
    mut stop: impl FnMut() -> bool,
) -> Result<Trained> {
    options.check()?;
    let plain = device.clone().without_autodiff();
    let tracking = plain.clone().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut decoder = Decoder::new(&Weights::seeded(options.bits, rng.next_u64())?, &tracking);
    let mut encoder = Encoder::new(options.bits, &mut rng, &tracking);
    let (mut of_decoder, mut of_encoder) = (Adam::default(), Adam::default());
    let mut curriculum = Curriculum::new();
    for step in 0..options.steps {
        if stop() {
            return Err(Error::Stopped);
        }
        let (psnr, part) = options.stage(curriculum.done);
        let clean = next(&mut pictures, options.batch, &plain)?;
        let messages = messages(options.batch, options.bits, &mut rng, &plain);
        let marked = encoder.forward(clean, messages.clone(), strength(psnr));
        let seen = options.geometry.scaled(part).apply(marked, &mut rng);
        let seen = options.distortions.apply(seen, [0.0; 3], &mut rng);
        let loss = cross_entropy(decoder.forward(seen), messages);
        let value = loss.clone().into_scalar::<f32>();
        if !value.is_finite() {
            let what = "loss";
            return Err(Error::NotFinite { what, value, step });
        }
        curriculum.step(value, options.steps);
        if step % REPORT == 0 || step + 1 == options.steps {
            progress(Progress {
                step: step + 1,
                steps: options.steps,
                loss: value,
                psnr,
            });
        }
        let gradients = loss.backward();
        decoder = of_decoder.step(options.rate(step), decoder, &gradients);
        encoder = of_encoder.step(options.rate(step), encoder, &gradients);
    }
    Ok(Trained {
        weights: decoder.valid().weights()?,
        encoder: encoder.valid(),
        device: plain,
    })
}

/// Root mean square of a residual of some PSNR in dB.
pub(crate) fn strength(psnr: f32) -> f32 {
    10_f32.powf(-psnr / 20.0)
}

/// `count` random messages `[count, bits]` of 0 and 1.
pub(crate) fn messages(count: usize, bits: usize, rng: &mut impl Rng, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = (0..count * bits).map(|_| (rng.next_u32() >> 31) as f32).collect();
    Tensor::from_data(TensorData::new(values, [count, bits]), device)
}

/// Pictures from the caller, checked and on `device`.
pub(crate) fn next(
    pictures: &mut impl FnMut(usize) -> Result<Tensor<4>>,
    count: usize,
    device: &Device,
) -> Result<Tensor<4>> {
    let batch = pictures(count)?;
    let shape @ [b, channels, h, w] = batch.dims();
    if b != count || channels != 3 || h.min(w) < 32 || h % 2 + w % 2 > 0 {
        let expected = "[as many as asked for, 3, h, w] with even sides of at least 32";
        return Err(Error::BadShape { shape, expected });
    }
    Ok(batch.to_device(device))
}

/// Mean binary cross entropy of logits against targets of exactly 0 or 1, both `[b, bits]`: the softplus of the logit,
/// its sign turned where the target is 1, which neither overflows nor cancels.
fn cross_entropy(logits: Tensor<2>, targets: Tensor<2>) -> Tensor<1> {
    softplus(logits * (targets * -2.0 + 1.0), 1.0).mean()
}

/// Share of logits on the side of their target, both `[b, bits]`.
pub(crate) fn accuracy(logits: Tensor<2>, targets: Tensor<2>) -> Result<f64> {
    let (logits, targets) = (host(logits)?, host(targets)?);
    let right = logits.iter().zip(&targets).filter(|(l, t)| (**l > 0.0) == (**t > 0.5));
    Ok(right.count() as f64 / targets.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::Synthetic;

    fn options() -> Options {
        Options {
            bits: 2,
            steps: 4,
            batch: 2,
            ..Options::default()
        }
    }

    fn run(options: &Options, side: usize, stop: bool) -> Result<Trained> {
        let device = Device::flex();
        let mut pictures = Synthetic::new(side, 5)?;
        train(options, &device, |n| Ok(pictures.next(n, &device)), |_| {}, || stop)
    }

    #[test]
    fn the_seed_decides_the_weights() {
        let first = run(&options(), 32, false).unwrap().weights;
        assert_eq!(run(&options(), 32, false).unwrap().weights, first);
        assert_ne!(first, Weights::seeded(2, 0).unwrap());
        let other = Options { seed: 1, ..options() };
        assert_ne!(run(&other, 32, false).unwrap().weights.head, first.head);
    }

    #[test]
    fn what_cannot_work_is_refused() {
        assert!(matches!(run(&options(), 32, true), Err(Error::Stopped)));
        assert!(matches!(run(&options(), 33, false), Err(Error::BadShape { .. })));
        let none = Options { bits: 0, ..options() };
        assert!(matches!(
            run(&none, 32, false),
            Err(Error::OutOfRange { field: "bits", .. })
        ));
        let faint = Options {
            end_psnr: f32::NAN,
            ..options()
        };
        assert!(
            run(&faint, 32, false)
                .unwrap_err()
                .to_string()
                .starts_with("end psnr is NaN")
        );
    }

    #[test]
    fn the_residual_has_the_strength_that_was_asked_for() {
        let device = Device::flex();
        let encoder = Encoder::new(3, &mut ChaCha8Rng::seed_from_u64(1), &device);
        let grey = Tensor::<4>::ones([1, 3, 40, 48], &device) * 0.5;
        let messages = Tensor::ones([1, 3], &device);
        let residual = encoder.forward(grey.clone(), messages, strength(34.0)) - grey;
        let square = host(residual.square().mean()).unwrap()[0];
        assert!((-10.0 * square.log10() - 34.0).abs() < 0.01, "{square}");
    }

    #[test]
    fn pictures_become_harder_once_messages_are_read() {
        let options = Options::default();
        let mut curriculum = Curriculum::new();
        for _ in 0..100 {
            curriculum.step(0.6, 100);
        }
        assert_eq!(options.stage(curriculum.done), (options.start_psnr, 0.0));
        for _ in 0..100 {
            curriculum.step(0.01, 100);
        }
        assert_eq!(options.stage(curriculum.done), (options.end_psnr, 1.0));
        assert_eq!(options.stage(0.5), (options.start_psnr, 1.0));
        assert!(options.rate(0) < 1e-4 && options.rate(options.steps - 1) < 1e-6);
    }
}
