//! How much memory an embedding will need.
use super::pool::PooledView;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::{Engine, cpu_weight_cache};
use crate::memory::Memory;
use crate::scene::{Gaussians, Scene};
use crate::splat::{PreparedView, prepare};
use crate::view::{Split, ViewSampler};

/// Numbers of a Gaussian besides its colour: position, rotation, scale, opacity.
const GEOMETRY: u64 = 11;
/// Pictures of a step, as large as those that CLIP sees, that differentiation keeps for each view: L1, SSIM with its
/// five windowed means, and the augmentation. Measured: a step of 16 views takes 62 MB more than one of 8 at 160 px.
const KEPT_PICTURES: u64 = 18;
/// Pictures of the size at which they are distorted that differentiation keeps for each view.
const KEPT_DISTORTED: u64 = 18;
/// Bytes of a Gaussian while a view is prepared: projected by chunks, put together, sorted.
const PREPARING: u64 = 150;

/// What of a scene decides how much memory it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneSize {
    /// Gaussians.
    pub gaussians: u64,
    /// Degree of the spherical harmonics in use.
    pub degree: u64,
    /// Degree that is learned.
    pub learned_degree: u64,
    /// Whether the file keeps colours as they are.
    pub exact: bool,
    /// Bytes of the file, uncompressed.
    pub file: u64,
}

impl SceneSize {
    /// Of a scene that was read.
    pub fn of(scene: &Scene) -> Self {
        Self {
            gaussians: scene.gaussians.len() as u64,
            degree: scene.gaussians.sh.degree as u64,
            learned_degree: scene.learnable_degree() as u64,
            exact: scene.exact(),
            file: scene.file_bytes() as u64,
        }
    }

    /// Bytes of the scene in memory: its file, and its numbers.
    pub fn bytes(&self) -> u64 {
        self.file + 4 * self.gaussians * (GEOMETRY + coefficients(self.degree))
    }
}

fn coefficients(degree: u64) -> u64 {
    3 * (degree + 1) * (degree + 1)
}

/// Bytes of prepared views: what all have alike, and what grows with their pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewSize {
    /// Of the Gaussians that a view shows.
    pub visible: f64,
    /// Of a pixel that is drawn.
    pub pixel: f64,
}

impl ViewSize {
    /// Measured on one training view that stands for a picture of its own size: those of larger ones have narrower splats.
    ///
    /// # Errors
    /// An empty scene, a failing device.
    pub fn measure(engine: &Engine, gaussians: &Gaussians, settings: &Settings) -> Result<Self> {
        let sampler = ViewSampler::new(gaussians, settings.seed)?;
        let camera = sampler.camera(Split::Training, 0, settings.size);
        let view = PooledView::new(engine, gaussians, &camera, 1.0, settings.half_weights, [1.0; 3])?.view;
        Ok(Self::of(&view))
    }

    /// The same view as the CPU keeps it, without an engine.
    ///
    /// # Errors
    /// An empty scene.
    pub fn on_cpu(gaussians: &Gaussians, settings: &Settings) -> Result<Self> {
        let sampler = ViewSampler::new(gaussians, settings.seed)?;
        let camera = sampler.camera(Split::Training, 0, settings.size);
        let cache = cpu_weight_cache(camera.width, settings.half_weights);
        Ok(Self::of(&prepare(gaussians, &camera, cache)?))
    }

    fn of(view: &PreparedView) -> Self {
        let weights = view.weight_bytes() as f64;
        let side = f64::from(view.camera.width);
        Self {
            visible: view.bytes() as f64 - weights,
            pixel: weights / (side * side),
        }
    }

    /// Mean bytes of a training view.
    fn mean(&self, settings: &Settings) -> f64 {
        // Its reference picture besides.
        self.visible + self.pixel * drawn_pixels(settings) + 12.0 * f64::from(settings.size).powi(2)
    }
}

/// Pixels of a training view.
fn drawn_pixels(settings: &Settings) -> f64 {
    f64::from(settings.size).powi(2)
}

/// Bytes of the models that are loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelBytes {
    /// While changes are learned.
    pub learning: u64,
    /// When the marked scene is verified: the perceptual distance is then measured, whether or not it is learned from.
    pub verifying: u64,
}

impl ModelBytes {
    /// Of an engine's models with these settings.
    pub fn of(engine: &Engine, settings: &Settings) -> Self {
        Self {
            learning: engine.model_bytes(settings.lambda.lpips > 0.0),
            verifying: engine.model_bytes(true),
        }
    }
}

/// Predicts the most memory that it takes to read a scene and draw pictures of it, of at most so many bytes
/// ([`picture_bytes`](crate::admission::picture_bytes)).
pub fn needs_to_render(scene: SceneSize, picture: u64) -> Memory {
    // The file has gone when views are prepared, one at a time.
    let preparing = PREPARING * scene.gaussians;
    Memory {
        scene: scene.bytes(),
        pictures: (preparing + picture).saturating_sub(scene.file),
        ..Memory::of_program()
    }
}

/// Predicts the most memory that an embedding has in use at once.
pub fn needs(scene: SceneSize, view: ViewSize, settings: &Settings, models: ModelBytes) -> Memory {
    let threads = rayon::current_num_threads() as u64;
    let learned = 4 * scene.gaussians * coefficients(scene.learned_degree);
    let mean = view.mean(settings);
    let kept = (settings.pool_views as f64 * mean).min((settings.pool_mebibytes << 20) as f64);
    // Fresh views have not come into the pool yet; those of the early stop stay.
    let fresh = settings
        .fresh_per_step
        .max(settings.views_per_step.saturating_sub(settings.pool_views));
    let in_hand = fresh as f64 * mean;
    let pixels = f64::from(settings.size).powi(2);
    let held_out = settings.early_stop.map_or(0.0, |stop| stop.views as f64) * (view.visible + pixels * view.pixel);
    let drawn = 2.0 * 12.0 * drawn_pixels(settings) * settings.views_per_step as f64;
    let picture = 12 * u64::from(settings.size).pow(2);
    let mut kept_pictures = settings.views_per_step as u64 * KEPT_PICTURES * picture;
    if settings.robust_to.of_pictures().next().is_some() {
        let large = 12 * u64::from(settings.distorted_size.max(settings.size)).pow(2);
        kept_pictures += settings.views_per_step as u64 * KEPT_DISTORTED * large;
    }
    let differentiating = drawn as u64 + kept_pictures;
    let preparing = threads * PREPARING * scene.gaussians;
    let optimising = Memory {
        models: models.learning,
        scene: scene.bytes(),
        offsets: 2 * learned + if scene.exact { 0 } else { learned } + 9 * scene.gaussians,
        optimiser: 2 * learned + 4 * scene.gaussians,
        views: (kept + in_hand + held_out) as u64,
        // First the one, then the other.
        pictures: differentiating.max(preparing),
        ..Memory::of_program()
    };
    // When the marked scene is verified, views and optimiser are gone, and there are two scenes.
    let verifying = Memory {
        models: models.verifying,
        scene: 2 * scene.bytes(),
        offsets: optimising.offsets - learned,
        pictures: 2 * settings.verify.views as u64 * picture + preparing,
        ..Memory::of_program()
    };
    if optimising.total() >= verifying.total() {
        optimising
    } else {
        verifying
    }
}
