//! Contrastive training of the text tower against the locked image tower, and retrieval on what it never saw.
use super::drawing::{Drawing, draw, random_view};
use super::paint::{Painter, SIDE};
use super::{TrainOptions, TrainProgress, host};
use crate::clip::{ClipConfig, ClipModel, Parts, normalize, preprocess};
use crate::device::Compute;
use crate::error::{Error, Result};
use burn::module::Module;
use burn::optim::{AdamWConfig, GradientsParams};
use burn::tensor::activation::log_softmax;
use burn::tensor::{Int, Tensor, TensorData};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Drawings that training chooses from; more are drawn for the measurement.
const DRAWINGS: usize = 512;
/// Pairs of the measurement.
const MEASURED: usize = 256;
/// Words in a caption of the measurement.
const MEASURED_WORDS: usize = 32;
/// Lengths of captions in training.
const WORDS: [usize; 4] = [8, 16, 32, 48];
/// Root mean square change that a caption makes on the object: 34 dB.
const STRENGTH: f32 = 0.02;
/// Highest rate of the optimiser.
const RATE: f64 = 2e-3;
const FIRST: i64 = 49406;
const END: i64 = 49407;

/// How often the right one of [`Retrieval::pairs`] is found first.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Retrieval {
    /// Pairs compared; chance is one in so many.
    pub pairs: usize,
    /// Share of pictures whose caption is nearest.
    pub picture_to_caption: f64,
    /// Share of captions whose picture is nearest.
    pub caption_to_picture: f64,
}

/// Pictures and their captions.
struct Pairs {
    /// L2-normalised features of the pictures, `[b, dim]`.
    pictures: Tensor<2>,
    captions: Vec<Vec<i64>>,
}

/// Trains the text tower of `model`; its image tower stays as it is.
pub(super) fn train(
    model: ClipModel,
    config: &ClipConfig,
    options: &TrainOptions,
    compute: &Compute,
    progress: &mut impl FnMut(TrainProgress),
) -> Result<(ClipModel, Retrieval)> {
    let tracking = compute.device.clone().autodiff();
    let mut student = ClipModel::init(config, Parts::Text, &tracking, options.seed);
    let tower = model.visual.as_ref().ok_or_else(|| missing("image"))?;
    let painter = Painter {
        tower,
        config,
        embedding: embedding(&student, config, compute)?,
        compute,
    };
    let locked = ImageSide { painter };
    let drawings: Vec<Drawing> = (0..DRAWINGS as u64)
        .into_par_iter()
        .map(|i| draw(options.seed ^ 0x0074_7261_696e, i))
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut optimizer = AdamWConfig::new()
        .with_beta_2(0.98)
        .with_epsilon(1e-8)
        .with_weight_decay(0.0)
        .init();
    for step in 0..options.steps {
        let words = WORDS[rng.random_range(0..WORDS.len())];
        let pairs = locked.pairs(&drawings, options.batch, words, &mut rng)?;
        let logits = similarities(&student, &pairs, compute)?;
        let loss = symmetric_loss(logits);
        let value: f32 = loss.clone().into_scalar();
        if !value.is_finite() {
            return Err(Error::NotFinite {
                step,
                term: "contrastive",
                value,
            });
        }
        let done = step as f64 / options.steps as f64;
        let rate = RATE * (step as f64 / 30.0).min(1.0) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
        let gradients = GradientsParams::from_grads(loss.backward(), &student);
        student = optimizer.step(rate, student, gradients);
        progress(TrainProgress::Contrastive(step + 1, options.steps, value));
    }
    let student = student.valid();
    let unseen: Vec<Drawing> = (0..MEASURED as u64)
        .into_par_iter()
        .map(|i| draw(options.seed ^ 0x7465_7374, i))
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0x7465_7374);
    let pairs = locked.pairs(&unseen, MEASURED, MEASURED_WORDS, &mut rng)?;
    let retrieval = retrieval(&host(similarities(&student, &pairs, compute)?, compute)?, MEASURED);
    Ok((
        ClipModel {
            visual: model.visual,
            ..student
        },
        retrieval,
    ))
}

/// The initial embedding of every token, `[vocab_size][width]`.
fn embedding(model: &ClipModel, config: &ClipConfig, compute: &Compute) -> Result<Vec<f32>> {
    let text = model.text.as_ref().ok_or_else(|| missing("text"))?;
    let table = host(text.token_embedding(), compute)?;
    debug_assert_eq!(table.len(), config.text.vocab_size * config.text.width);
    Ok(table)
}

fn missing(tower: &str) -> Error {
    Error::BadModel {
        name: "guardsplat-clip".into(),
        reason: format!("has no {tower} tower"),
    }
}

/// The locked image tower and what makes pictures for it.
struct ImageSide<'a> {
    painter: Painter<'a>,
}

impl ImageSide<'_> {
    /// `count` random captions of `words` words, each painted on a random view of a random drawing.
    fn pairs(&self, drawings: &[Drawing], count: usize, words: usize, rng: &mut impl Rng) -> Result<Pairs> {
        let captions: Vec<Vec<i64>> = (0..count)
            .map(|_| (0..words).map(|_| rng.random_range(1..FIRST)).collect())
            .collect();
        let chosen: Vec<(usize, u64)> = (0..count)
            .map(|_| (rng.random_range(0..drawings.len()), rng.random()))
            .collect();
        let views: Vec<(Vec<f32>, Vec<f32>)> = chosen
            .par_iter()
            .map(|&(drawing, seed)| random_view(&drawings[drawing], SIDE, &mut ChaCha8Rng::seed_from_u64(seed)))
            .collect();
        let mut pictures = Vec::with_capacity(count);
        let all = views.chunks(64).zip(captions.chunks(64));
        for (views, captions) in all {
            let planes: Vec<f32> = views.iter().flat_map(|v| &v.0).copied().collect();
            let masks: Vec<f32> = views.iter().flat_map(|v| &v.1).copied().collect();
            let painted = self.painter.paint(planes, masks, captions, STRENGTH)?;
            let input = preprocess(painted, SIDE, &self.painter.config.normalization);
            pictures.push(normalize(self.painter.tower.forward(input)));
        }
        Ok(Pairs {
            pictures: Tensor::cat(pictures, 0),
            captions,
        })
    }
}

/// Scaled cosine similarities, pictures by captions, `[b, b]`.
fn similarities(model: &ClipModel, pairs: &Pairs, compute: &Compute) -> Result<Tensor<2>> {
    let text = model.text.as_ref().ok_or_else(|| missing("text"))?;
    let scale = model.logit_scale.val();
    let device = scale.device();
    let words = pairs.captions.first().map_or(0, Vec::len);
    let tokens: Vec<i64> = pairs
        .captions
        .iter()
        .flat_map(|c| {
            std::iter::once(FIRST)
                .chain(c.iter().copied())
                .chain(std::iter::once(END))
        })
        .collect();
    let tokens = TensorData::new(tokens, [pairs.captions.len(), words + 2]);
    let features = normalize(text.forward(Tensor::<2, Int>::from_data(tokens, &device)));
    let pictures = host(pairs.pictures.clone(), compute)?;
    let pictures = Tensor::<2>::from_data(TensorData::new(pictures, pairs.pictures.dims()), &device);
    // CLIP bounds the scale at 100.
    let scale = scale.exp().clamp(1.0, 100.0).reshape([1, 1]);
    Ok(pictures.matmul(features.transpose()) * scale)
}

/// Mean cross entropy of the right partner, over rows and over columns (Radford et al. 2021, figure 3).
fn symmetric_loss(logits: Tensor<2>) -> Tensor<1> {
    let n = logits.dims()[0];
    let right = Tensor::<2>::eye(n, &logits.device());
    let rows = (log_softmax(logits.clone(), 1) * right.clone()).sum();
    let columns = (log_softmax(logits, 0) * right).sum();
    (rows + columns).div_scalar(-2.0 * n as f32)
}

/// Retrieval in both directions from similarities `[n][n]`, whose diagonal holds the right pairs.
fn retrieval(similarities: &[f32], n: usize) -> Retrieval {
    let best = |at: &dyn Fn(usize, usize) -> f32| {
        let right = (0..n)
            .filter(|&i| (0..n).all(|j| j == i || at(i, j) < at(i, i)))
            .count();
        right as f64 / n as f64
    };
    Retrieval {
        pairs: n,
        picture_to_caption: best(&|i, j| similarities[i * n + j]),
        caption_to_picture: best(&|i, j| similarities[j * n + i]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn retrieval_counts_rows_and_columns() {
        // Picture 1's best caption is 0; caption 1's best picture is 1, caption 0's too.
        let found = retrieval(&[0.5, 0.1, 0.6, 0.4], 2);
        assert_eq!((found.picture_to_caption, found.caption_to_picture), (0.5, 0.5));
    }

    #[test]
    fn loss_of_equal_similarities_is_chance_and_of_right_ones_nothing() {
        let device = Device::flex();
        let chance: f32 = symmetric_loss(Tensor::zeros([8, 8], &device)).into_scalar();
        assert!((chance - 8_f32.ln()).abs() < 1e-5, "{chance}");
        let right: f32 = symmetric_loss(Tensor::eye(8, &device).mul_scalar(100.0)).into_scalar();
        assert!(right.abs() < 1e-5, "{right}");
    }
}
