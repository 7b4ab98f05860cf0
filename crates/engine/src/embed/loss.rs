//! The part of the loss that is computed on pictures: reconstruction and message, and its gradient to the pictures.
//!
//! `reconstruction * (l1 * L1 + l2 * L2 + ssim * (1 - SSIM) + lpips * LPIPS) + message * t BCE(logits / t)`, means over the views
//! of a step. On the CPU likeness and its gradient are computed by loops of our own, and only what reads the message, and
//! LPIPS, is a graph.
use burn::tensor::{Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::image_augmentation::ImageAugmentation;
use super::loss_weight_controller::LossWeightFactors;
use super::progress::LossTerms;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::message::{Message, bce_from_logits};
use crate::picture::Picture;
use crate::quality::{Likeness, LikenessWeights, Ssim, batch, likeness_with_gradient, unbatch};

/// What is fixed for a run.
pub(super) struct Loss<'a> {
    engine: &'a Engine,
    settings: Settings,
    image_augmentation: ImageAugmentation,
    targets: Vec<f32>,
    ssim: Ssim,
}

/// The loss of a batch of views.
pub(super) struct Evaluated {
    /// Its terms; the offset penalty is added elsewhere.
    pub terms: LossTerms,
    /// Gradient to each picture, laid out as its pixels.
    pub gradients: Vec<Picture>,
    /// Share of right bits in the augmented views.
    pub bit_accuracy: f64,
}

impl<'a> Loss<'a> {
    pub fn new(engine: &'a Engine, settings: &Settings, message: &Message) -> Self {
        let side = settings.size as usize;
        Self {
            engine,
            settings: *settings,
            image_augmentation: ImageAugmentation::new(settings, engine),
            targets: message.targets().collect(),
            ssim: Ssim::new(side, side, &engine.compute.device),
        }
    }

    /// Divides logits by `temperature` from now on.
    pub fn set_temperature(&mut self, temperature: f32) {
        self.settings.lambda.temperature = temperature;
    }

    /// Loss and gradient of `pictures` against `references`, with terms multiplied by `factors`.
    ///
    /// # Errors
    /// [`Error::NotFinite`] with the term, or a failing device.
    pub fn evaluate(
        &self,
        step: usize,
        pictures: &[&Picture],
        references: &[&Picture],
        factors: LossWeightFactors,
        rng: &mut ChaCha8Rng,
    ) -> Result<Evaluated> {
        let device = &self.engine.compute.device;
        let lambda = &self.settings.lambda;
        let weight = lambda.reconstruction * factors.reconstruction;
        let views = pictures.len();
        let leaf = batch(pictures, &device.clone().autodiff())?.require_grad();
        // What a file can hold; beyond it nothing is seen, so there is no gradient either.
        let marked = leaf.clone().clamp(0.0, 1.0);
        let original = || Ok::<_, Error>(Tensor::from_inner(batch(references, device)?.clamp(0.0, 1.0)));

        let mut total = Vec::new();
        let mut parts = Vec::new();
        let by_hand = if self.engine.on_cpu() {
            let weights = LikenessWeights {
                l1: weight * lambda.l1,
                l2: weight * lambda.l2,
                ssim: -weight * lambda.ssim * factors.ssim,
            };
            let pairs: Vec<(&Picture, &Picture)> = references.iter().copied().zip(pictures.iter().copied()).collect();
            Some(likeness_with_gradient(&pairs, weights))
        } else {
            let original = original()?;
            let difference = marked.clone() - original.clone();
            let l1 = difference.clone().abs().mean();
            let l2 = difference.square().mean();
            let ssim = -self.ssim.mean(original, marked.clone()) + 1.0;
            let terms = l1.clone() * lambda.l1 + l2 * lambda.l2 + ssim.clone() * (lambda.ssim * factors.ssim);
            total.push(terms * weight);
            parts.extend([l1, ssim]);
            None
        };
        let lpips = if lambda.lpips > 0.0 { self.engine.lpips()? } else { None };
        if let Some(lpips) = lpips {
            let (original, marked) = (self.some(step, original()?), self.some(step, marked.clone()));
            let distance = lpips.per_view(original, marked)?.mean();
            total.push(distance.clone() * (lambda.lpips * weight));
            parts.push(distance);
        }
        let seen = self.settings.augmentation.apply(marked, rng);
        let logits = self.image_augmentation.logits(self.engine, seen, rng)?;
        let bits = self.targets.len();
        let targets = TensorData::new(self.targets.repeat(views), [views, bits]);
        let targets = Tensor::<2>::from_data(targets, device);
        let softened = logits.clone() / lambda.temperature;
        let message = bce_from_logits(softened, Tensor::from_inner(targets)) * lambda.temperature;
        parts.push(message.clone());
        let total = total.into_iter().fold(message * lambda.message, |sum, term| sum + term);

        // One transfer for all terms.
        let mut values = self.engine.to_host(Tensor::cat(parts, 0).inner())?;
        let message = values.pop().unwrap_or(f32::NAN);
        let lpips = lpips.and_then(|_| values.pop());
        let [l1, ssim] = match &by_hand {
            Some((views, _)) => mean_terms(views),
            None => [values[0], values[1]],
        };
        let terms = LossTerms {
            l1,
            ssim,
            message,
            lpips,
            offset: 0.0,
        };
        check_finite(step, &terms)?;

        let gradients = total.backward();
        let gradient = leaf.grad(&gradients).ok_or_else(|| Error::Device {
            device: self.engine.compute.name.clone(),
            reason: "the loss has no gradient to the pictures".into(),
        })?;
        let mut gradients = unbatch(gradient)?;
        if let Some((_, likeness)) = by_hand {
            gradients.par_iter_mut().zip(likeness).for_each(|(gradient, likeness)| {
                let both = gradient.pixels.iter_mut().zip(likeness);
                both.for_each(|(sum, term)| *sum += term);
            });
        }
        let of_view = |gradient: &Picture| gradient.pixels.iter().map(|g| g.abs()).sum::<f32>();
        let sums: Vec<f32> = gradients.par_iter().map(of_view).collect();
        finite(step, "gradient", sums.iter().sum())?;
        let logits = self.engine.to_host(logits.inner())?;
        let right = logits
            .iter()
            .zip(self.targets.iter().cycle())
            .filter(|(logit, target)| (**logit > 0.0) == (**target > 0.5))
            .count();
        Ok(Evaluated {
            terms,
            gradients,
            bit_accuracy: right as f64 / logits.len() as f64,
        })
    }

    /// The views of a step that LPIPS looks at: a window that moves on at every step, and comes around.
    fn some(&self, step: usize, pictures: Tensor<4>) -> Tensor<4> {
        let views = pictures.dims()[0];
        let Some(count) = self.settings.lpips_views.filter(|count| *count < views) else {
            return pictures;
        };
        let places: Vec<i64> = (0..count).map(|i| ((step * count + i) % views) as i64).collect();
        let places = Tensor::<1, Int>::from_data(TensorData::new(places, [count]), &pictures.device());
        pictures.select(0, places)
    }
}

/// L1 and 1 - SSIM, the means over views.
fn mean_terms(views: &[Likeness]) -> [f32; 2] {
    let mean = |of: fn(&Likeness) -> f64| views.iter().map(of).sum::<f64>() / views.len() as f64;
    [mean(|view| view.l1) as f32, (1.0 - mean(|view| view.ssim)) as f32]
}

fn check_finite(step: usize, terms: &LossTerms) -> Result<()> {
    finite(step, "L1", terms.l1)?;
    finite(step, "SSIM", terms.ssim)?;
    finite(step, "LPIPS", terms.lpips.unwrap_or(0.0))?;
    finite(step, "message", terms.message)
}

/// Fails with [`Error::NotFinite`] unless `value` is a number.
pub(super) fn finite(step: usize, term: &'static str, value: f32) -> Result<()> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Error::NotFinite { step, term, value })
}
