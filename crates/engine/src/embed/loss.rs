//! The part of the loss that is computed on pictures: reconstruction and message, and its gradient to the pictures.
//!
//! `reconstruction * (l1 * L1 + l2 * L2 + ssim * (1 - SSIM) + lpips * LPIPS) + message * t BCE(logits / t)`, means over the views
//! of a step. Likeness and its gradient are computed by loops and kernels of our own; only what reads the message, and LPIPS,
//! is a graph.
use burn::tensor::{Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::image_augmentation::ImageAugmentation;
use super::loss_weight_controller::LossWeightFactors;
use super::progress::LossTerms;
use super::settings::Settings;
use crate::card::{cross_entropy, on_card};
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::message::{Message, bce_from_logits};
use crate::picture::Picture;
use crate::quality::{Likeness, LikenessOnDevice, LikenessWeights, batch, likeness_with_gradient, unbatch};

/// What is fixed for a run.
pub(super) struct Loss<'a> {
    engine: &'a Engine,
    settings: Settings,
    image_augmentation: ImageAugmentation,
    message: Message,
    /// The bits of its word, `[1, bits]`.
    targets: Tensor<2>,
}

/// The loss of a batch of views.
pub(super) struct Evaluated {
    /// Its terms; the offset penalty is added elsewhere.
    pub terms: LossTerms,
    /// Share of right bits in the augmented views.
    pub bit_accuracy: f64,
    /// Mean PSNR of clamped pictures, dB; infinite where all are identical.
    pub psnr_db: f64,
}

/// What is computed of a batch as a graph.
struct Graph {
    lpips: Option<Tensor<1>>,
    message: Tensor<1>,
    logits: Tensor<2>,
}

impl Graph {
    /// All numbers, the logits last.
    fn numbers(&self) -> Vec<Tensor<1>> {
        let logits = self.logits.clone().flatten(0, 1);
        let terms = self.lpips.iter().chain([&self.message, &logits]);
        terms.map(|numbers| numbers.clone().inner()).collect()
    }
}

impl<'a> Loss<'a> {
    /// # Errors
    /// A message that is not of the key's length.
    pub fn new(engine: &'a Engine, settings: &Settings, message: &Message) -> Result<Self> {
        let targets: Vec<f32> = engine.message_code.word(message)?.targets().collect();
        let shape = [1, targets.len()];
        Ok(Self {
            engine,
            settings: *settings,
            image_augmentation: ImageAugmentation::new(settings, engine),
            targets: Tensor::from_data(TensorData::new(targets, shape), &engine.compute.device),
            message: *message,
        })
    }

    /// Divides logits by `temperature` from now on.
    pub fn set_temperature(&mut self, temperature: f32) {
        self.settings.lambda.temperature = temperature;
    }

    /// Loss of `pictures` against `references`, with terms multiplied by `factors`, and its gradient to each picture.
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
    ) -> Result<(Evaluated, Vec<Picture>)> {
        let device = &self.engine.compute.device;
        let leaf = batch(pictures, &device.clone().autodiff())?.require_grad();
        let pairs: Vec<(&Picture, &Picture)> = references.iter().copied().zip(pictures.iter().copied()).collect();
        let (likeness, likeness_gradients) = likeness_with_gradient(&pairs, self.likeness_weights(factors));
        let original = || batch(references, device);
        let graph = self.graph(step, leaf.clone().clamp(0.0, 1.0), original, rng)?;
        let numbers = self.engine.to_host(Tensor::cat(graph.numbers(), 0))?;
        let evaluated = self.evaluated(step, &numbers, mean_terms(&likeness), mean_psnr(references, pictures))?;

        let gradient = self.gradient(&self.total(&graph, factors), &leaf)?;
        let mut gradients = unbatch(gradient)?;
        gradients
            .par_iter_mut()
            .zip(&likeness_gradients)
            .for_each(|(gradient, likeness)| {
                let both = gradient.pixels.iter_mut().zip(likeness);
                both.for_each(|(sum, term)| *sum += term);
            });
        let of_view = |gradient: &Picture| gradient.pixels.iter().map(|g| g.abs()).sum::<f32>();
        let sums: Vec<f32> = gradients.par_iter().map(of_view).collect();
        finite(step, "gradient", sums.iter().sum())?;
        Ok((evaluated, gradients))
    }

    /// [`Loss::evaluate`] of `[views, 3, height, width]` that stay on the device: the gradient to the pictures, and numbers that
    /// [`Loss::evaluated_on_device`] takes one after the other. Nothing is waited for.
    ///
    /// # Errors
    /// A failing device.
    pub fn evaluate_on_device(
        &self,
        step: usize,
        pictures: Tensor<4>,
        originals: Tensor<4>,
        factors: LossWeightFactors,
        rng: &mut ChaCha8Rng,
    ) -> Result<(Tensor<4>, Vec<Tensor<1>>)> {
        let weights = self.likeness_weights(factors);
        let likeness = LikenessOnDevice::new(originals.clone(), pictures, weights)?;
        let leaf = Tensor::from_inner(likeness.clamped.clone()).require_grad();
        let graph = self.graph(step, leaf.clone(), || Ok(originals), rng)?;
        let mut numbers = vec![likeness.means.clone().flatten(0, 1)];
        numbers.extend(graph.numbers());
        // Where it is the only term its weight takes no launch.
        let (total, times) = match graph.lpips {
            Some(_) => (self.total(&graph, factors), 1.0),
            None => (graph.message, self.settings.lambda.message),
        };
        let gradient = likeness.gradient_with(self.gradient(&total, &leaf)?, times)?;
        Ok((gradient, numbers))
    }

    /// What the numbers of [`Loss::evaluate_on_device`] say.
    ///
    /// # Errors
    /// [`Error::NotFinite`] with the term.
    pub fn evaluated_on_device(&self, step: usize, numbers: &[f32], views: usize) -> Result<Evaluated> {
        let mean = |of: &[f32]| of.iter().sum::<f32>() / views as f32;
        let (likeness, numbers) = numbers.split_at(3 * views);
        let [ssim, l1, mse] = [0, 1, 2].map(|part| &likeness[part * views..][..views]);
        let psnrs = mse.iter().map(|mse| -10.0 * f64::from(*mse).log10());
        let terms = [mean(l1), 1.0 - mean(ssim)];
        self.evaluated(step, numbers, terms, psnrs.sum::<f64>() / views as f64)
    }

    fn likeness_weights(&self, factors: LossWeightFactors) -> LikenessWeights {
        let lambda = &self.settings.lambda;
        let weight = lambda.reconstruction * factors.reconstruction;
        LikenessWeights {
            l1: weight * lambda.l1,
            l2: weight * lambda.l2,
            ssim: -weight * lambda.ssim * factors.ssim,
        }
    }

    /// The loss of marked pictures as a graph, without what is computed by hand: of what a file can hold of them, since beyond
    /// it nothing is seen. `original` is asked for where LPIPS is.
    fn graph(
        &self,
        step: usize,
        marked: Tensor<4>,
        original: impl FnOnce() -> Result<Tensor<4>>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Graph> {
        let lambda = &self.settings.lambda;
        let lpips = if lambda.lpips > 0.0 { self.engine.lpips()? } else { None };
        let lpips = match lpips {
            Some(lpips) => {
                let original = self.some(step, Tensor::from_inner(original()?.clamp(0.0, 1.0)));
                Some(lpips.per_view(original, self.some(step, marked.clone()))?.mean())
            }
            None => None,
        };
        let seen = self.settings.augmentation.apply(marked, rng);
        let logits = self.image_augmentation.logits(self.engine, seen, rng)?;
        let (targets, temperature) = (Tensor::from_inner(self.targets.clone()), lambda.temperature);
        let message = match on_card(&logits) {
            true => cross_entropy(logits.clone(), targets, temperature),
            false => bce_from_logits(logits.clone() / temperature, targets) * temperature,
        };
        Ok(Graph { lpips, message, logits })
    }

    /// The weighted sum of a graph's terms.
    fn total(&self, graph: &Graph, factors: LossWeightFactors) -> Tensor<1> {
        let lambda = &self.settings.lambda;
        let weight = lambda.reconstruction * factors.reconstruction;
        let total = graph.message.clone() * lambda.message;
        match &graph.lpips {
            Some(distance) => total + distance.clone() * (lambda.lpips * weight),
            None => total,
        }
    }

    /// The gradient to the pictures, which are the graph's leaf.
    fn gradient(&self, total: &Tensor<1>, leaf: &Tensor<4>) -> Result<Tensor<4>> {
        let gradients = total.clone().backward();
        leaf.grad(&gradients).ok_or_else(|| Error::Device {
            device: self.engine.compute.name.clone(),
            reason: "the loss has no gradient to the pictures".into(),
        })
    }

    /// What [`Graph::numbers`] say, beside L1 and 1 - SSIM.
    fn evaluated(&self, step: usize, numbers: &[f32], [l1, ssim]: [f32; 2], psnr_db: f64) -> Result<Evaluated> {
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next().unwrap_or(f32::NAN);
        let lpips = self.settings.lambda.lpips > 0.0 && self.engine.has_lpips();
        let lpips = lpips.then(&mut next);
        let message = next();
        let terms = LossTerms {
            l1,
            ssim,
            message,
            lpips,
            offset: 0.0,
        };
        check_finite(step, &terms)?;
        let logits: Vec<f32> = numbers.collect();
        let views: Vec<&[f32]> = logits.chunks_exact(self.engine.bits).collect();
        let code = &self.engine.message_code;
        let wrong = views.par_iter().map(|view| code.wrong_bits(view, &self.message));
        let wrong: u32 = wrong.collect::<guardsplat_codeword::Result<Vec<u32>>>()?.iter().sum();
        let bits = self.message.len() * views.len();
        Ok(Evaluated {
            terms,
            bit_accuracy: 1.0 - f64::from(wrong) / bits.max(1) as f64,
            psnr_db,
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

/// Mean PSNR of clamped pictures, infinite where all are identical.
fn mean_psnr(references: &[&Picture], pictures: &[&Picture]) -> f64 {
    let of = |(a, b): (&&Picture, &&Picture)| {
        let squares = a.pixels.iter().zip(&b.pixels).map(|(a, b)| {
            let difference = a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0);
            f64::from(difference * difference)
        });
        let mse = squares.sum::<f64>() / a.pixels.len() as f64;
        -10.0 * mse.log10()
    };
    let views: Vec<f64> = references.par_iter().zip(pictures).map(of).collect();
    views.iter().sum::<f64>() / pictures.len() as f64
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
