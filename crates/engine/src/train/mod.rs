//! Trains the small CLIP that the project ships, from pictures and captions that it generates itself.
//!
//! 1. [`filters`]: the image tower's filters are random and stay so.
//! 2. [`head`]: its linear head is the one, in closed form, whose features a small change of a scene's colours moves
//!    most in all its views ([`steering`]), against how much they change from view to view by themselves; both are
//!    measured on sample scenes ([`scenes`]), clean or roughened ([`roughness`]).
//! 3. [`drawing`], [`paint`]: a caption is a sequence of words; each word means a direction of the image tower's
//!    features; the picture of a caption is a drawing, changed a little so that its features go where the words point.
//! 4. [`contrastive`]: the text tower is trained against the locked image tower with CLIP's symmetric loss (locked-image
//!    tuning, Zhai et al. 2022), and retrieval is measured on drawings and captions that it never saw.
mod contrastive;
mod drawing;
#[cfg(test)]
mod encoder_tests;
mod filters;
mod head;
mod paint;
mod roughness;
mod scenes;
mod steering;

pub use contrastive::Retrieval;
pub use drawing::{Drawing, SIDE, draw, random_view};
#[cfg(test)]
pub(crate) use filters::filters;

use crate::clip::config::{
    Activation, BlockConfig, EndToken, Normalization, TextConfig, Tones, VisionConfig, VisionTower,
};
use crate::clip::{ClipConfig, ClipModel, ImageTower, Parts, RandomFourierEncoder};
use crate::device::Compute;
use crate::error::{Error, Result};
use burn::tensor::Tensor;

/// How to train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// Decides everything that is random.
    pub seed: u64,
    /// Sample scenes whose natural variation is measured.
    pub scenes: usize,
    /// Other sample scenes, whose gradients are measured.
    pub steered: usize,
    /// How rough the scenes are: 0 for samples as they are, 1 for the limits of [`roughness`].
    pub roughness: f32,
    /// Steps of contrastive training.
    pub steps: usize,
    /// Pairs a step.
    pub batch: usize,
    /// Filters a scale.
    pub filters: usize,
    /// Sides of the squares that are averaged into one pixel of a scale.
    pub scales: Vec<usize>,
    /// Side of the square whose mean is subtracted from a pixel, odd.
    pub surround: usize,
    /// Least and largest norm of a filter; see [`filters`].
    pub norm: [f32; 2],
    /// Share of lightness in the direction of a filter, against what a random direction has.
    pub luma: f32,
    /// What the density of a pixel's colour counts against it, 0 to 1.
    pub equalization: f32,
    /// Width of the features.
    pub dims: usize,
    /// Width of the text tower.
    pub text_width: usize,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            scenes: 640,
            steered: 3,
            roughness: 0.0,
            steps: 200,
            batch: 64,
            filters: 128,
            scales: vec![1, 2, 4],
            surround: 1,
            norm: filters::NORM,
            luma: filters::LUMA,
            equalization: EQUALIZATION,
            dims: 152,
            text_width: 128,
        }
    }
}

/// What training is doing, for a progress display: the stage, done, of so many, and what is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrainProgress {
    /// Scenes whose features were measured.
    Natural(usize, usize),
    /// Scenes whose gradients were measured.
    Steering(usize, usize),
    /// Steps of contrastive training, and the loss.
    Contrastive(usize, usize, f32),
}

/// A trained model and what was measured of it.
#[derive(Debug)]
pub struct TrainedClip {
    /// Its sizes.
    pub config: ClipConfig,
    /// Its weights.
    pub model: ClipModel,
    /// Per kept direction, in the order of the fit: how far a change of a scene that changes its pictures by length 1 moves
    /// the feature in views that it was not fitted to, in standard deviations of its natural variation in scenes that the
    /// head was not fitted to.
    pub steering: Vec<f64>,
    /// On drawings and captions that training never saw.
    pub retrieval: Retrieval,
}

/// What the density of a pixel's colour counts against it. Large plain areas say less of a scene than their size; much more
/// than this and a mark's reach is in a few pixels of each view (docs/clip.md, "Rare colours weigh more").
const EQUALIZATION: f32 = 0.2;

/// Side of the pictures that the model takes.
const IMAGE_SIZE: usize = 160;

/// The sizes of the model that these options make.
pub fn config(options: &TrainOptions) -> ClipConfig {
    let blocks = BlockConfig {
        layers: 2,
        heads: 2,
        mlp_width: 4 * options.text_width,
        activation: Activation::QuickGelu,
        norm_epsilon: 1e-5,
    };
    ClipConfig {
        embed_dim: options.dims,
        vision: VisionConfig {
            image_size: IMAGE_SIZE,
            width: options.filters,
            tower: VisionTower::Statistics {
                scales: options.scales.clone(),
                kernel: filters::KERNEL,
                surround: options.surround,
                tones: Tones::Estimated,
                equalization: options.equalization,
            },
        },
        text: TextConfig {
            context_length: 77,
            vocab_size: 49408,
            width: options.text_width,
            blocks,
            end: EndToken::Largest,
        },
        normalization: Normalization::default(),
    }
}

/// Trains a model from nothing. On the CPU device the same options give the same weights.
///
/// # Errors
/// Options outside their limits, a failing device, and a loss that stops being a number.
pub fn train_clip(
    options: &TrainOptions,
    compute: &Compute,
    mut progress: impl FnMut(TrainProgress),
) -> Result<TrainedClip> {
    check(options)?;
    let config = config(options);
    let model = ClipModel::init(&config, Parts::Both, &compute.device, options.seed);
    let (filters, mut phases) = filters::filters(
        options.filters * options.scales.len(),
        options.norm,
        options.luma,
        options.seed,
    );
    if options.surround > 1 {
        // What is alike all around is 0 already.
        phases.fill(0.0);
    }
    let tower = tower(&model)?.with_filters(&filters, &phases);
    let head = head::fit(&tower, &config, options, compute, &mut progress)?;
    let tower = tower.with_head(head.matrix, head.bias);
    let model = ClipModel {
        visual: Some(ImageTower::RandomFourier(tower)),
        ..model
    };
    let (model, retrieval) = contrastive::train(model, &config, options, compute, &mut progress)?;
    Ok(TrainedClip {
        config,
        model,
        steering: head.steering,
        retrieval,
    })
}

fn tower(model: &ClipModel) -> Result<RandomFourierEncoder> {
    match &model.visual {
        Some(ImageTower::RandomFourier(tower)) => Ok(tower.clone()),
        _ => Err(Error::BadModel {
            name: "guardsplat-clip".into(),
            reason: "has another image tower".into(),
        }),
    }
}

fn check(options: &TrainOptions) -> Result<()> {
    for (field, value, least, most) in [
        ("--scenes", options.scenes, 8, 1 << 16),
        ("--steered", options.steered, 1, 1 << 10),
        ("--steps", options.steps, 1, 1 << 20),
        ("--batch", options.batch, 2, 1024),
        ("--filters", options.filters, 1, 4096),
        ("--dims", options.dims, 1, options.filters * options.scales.len()),
    ] {
        if !(least..=most).contains(&value) {
            return Err(Error::BadOption {
                field,
                reason: format!("{value} is outside {least} to {most}"),
            });
        }
    }
    if !(0.0..=10.0).contains(&options.roughness) {
        return Err(Error::BadOption {
            field: "--roughness",
            reason: format!("{} is outside 0 to 10", options.roughness),
        });
    }
    if !(0.0..=1.0).contains(&options.equalization) {
        return Err(Error::BadOption {
            field: "--equalization",
            reason: format!("{} is outside 0 to 1", options.equalization),
        });
    }
    Ok(())
}

/// The values of a tensor, on the host.
fn host<const D: usize>(tensor: Tensor<D>, compute: &Compute) -> Result<Vec<f32>> {
    tensor.try_into_vec_as::<f32>().map_err(|e| Error::Device {
        device: compute.name.clone(),
        reason: e.to_string(),
    })
}
