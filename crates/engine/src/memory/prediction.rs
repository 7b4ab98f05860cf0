//! Predicts how much memory rendering and embedding take, from sizes alone.
use super::MemoryRequirements;
use crate::scene::Scene;

/// Numbers of a Gaussian besides its colour: position, rotation, scale, opacity.
const GEOMETRY: u64 = 11;
/// Pictures of a step, as large as those that CLIP sees, that the loss and its gradient keep for each view on the CPU: the
/// pictures themselves, the windowed means of SSIM, the tower's. Measured: a step of 16 views takes 30 MB more than one of
/// 8 at 160 px, and one of 24 another 32 MB, with what is drawn.
const KEPT_PICTURES: u64 = 11;
/// Pictures of the size at which they are distorted that differentiation keeps for each view.
const KEPT_DISTORTED: u64 = 18;
/// Bytes of a Gaussian while a view is prepared: projected by chunks, put together (44 each), sorted.
const PREPARING: u64 = 120;
/// Bytes of a Gaussian that all views of a scene are prepared from: its scales and its opacity, worked out.
const GEOMETRY_OF_VIEWS: u64 = 28;

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
    /// Mean bytes of a training view of `side` x `side` pixels and of its reference picture.
    fn mean(&self, side: u32) -> f64 {
        self.visible + self.pixel * pixels(side) + 12.0 * pixels(side)
    }
}

fn pixels(side: u32) -> f64 {
    f64::from(side).powi(2)
}

/// Bytes of the models that are loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelBytes {
    /// While changes are learned.
    pub learning: u64,
    /// When the marked scene is verified: the perceptual distance is then measured, whether or not it is learned from.
    pub verifying: u64,
}

/// What of an embedding's settings decides how much memory it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EmbeddingWorkload {
    /// Marks that are made of the scene at once.
    pub marks: u64,
    /// Side of training views in pixels.
    pub size: u32,
    /// Side in pixels to which views are enlarged before they are distorted; `None` where none are.
    pub distorted_size: Option<u32>,
    /// Views a step.
    pub views_per_step: usize,
    /// How many of them are new.
    pub fresh_per_step: usize,
    /// Steps to come whose new views are prepared meanwhile.
    pub steps_ahead: usize,
    /// Most views that are kept for later steps.
    pub pool_views: usize,
    /// Most bytes that these take.
    pub pool_bytes: usize,
    /// Held-out views of the early stop.
    pub early_stop_views: usize,
    /// Held-out views of the verification.
    pub verification_views: usize,
}

/// Bytes of a picture of so many pixels as it is drawn, and again in 8 bits a channel.
pub fn picture_bytes(width: u32, height: u32) -> u64 {
    2 * 12 * u64::from(width) * u64::from(height)
}

/// Predicts the most memory that it takes to read a scene and draw pictures of it, of at most `picture` bytes
/// ([`picture_bytes`]).
pub fn rendering_requirements(scene: SceneSize, picture: u64) -> MemoryRequirements {
    // The file has gone when views are prepared, one at a time.
    let preparing = (PREPARING + GEOMETRY_OF_VIEWS) * scene.gaussians;
    MemoryRequirements {
        scene: scene.bytes(),
        pictures: (preparing + picture).saturating_sub(scene.file),
        ..MemoryRequirements::of_program()
    }
}

/// Predicts the most memory that an embedding has in use at once.
pub fn embedding_requirements(
    scene: SceneSize,
    view: ViewSize,
    work: &EmbeddingWorkload,
    models: ModelBytes,
) -> MemoryRequirements {
    let threads = rayon::current_num_threads() as u64;
    let learned = 4 * scene.gaussians * coefficients(scene.learned_degree);
    let mean = view.mean(work.size);
    let all = work.pool_views as f64 * mean;
    let kept = all.min(work.pool_bytes as f64);
    let fresh = work
        .fresh_per_step
        .max(work.views_per_step.saturating_sub(work.pool_views));
    // Fresh views push others out of the pool; where it holds few, a step still draws some of these.
    let pushed_out = match kept < all {
        true => fresh.min(work.views_per_step.saturating_sub(fresh)),
        false => 0,
    };
    // Fresh views, and those of steps to come, have not come into the pool yet; those of the early stop stay.
    let in_hand = (fresh + pushed_out + work.steps_ahead * work.fresh_per_step) as f64 * mean;
    let held_out = work.early_stop_views as f64 * (view.visible + pixels(work.size) * view.pixel);
    let drawn = 2.0 * 12.0 * pixels(work.size) * work.views_per_step as f64;
    let picture = 12 * u64::from(work.size).pow(2);
    let mut kept_pictures = work.views_per_step as u64 * KEPT_PICTURES * picture;
    if let Some(distorted_size) = work.distorted_size {
        let large = 12 * u64::from(distorted_size.max(work.size)).pow(2);
        kept_pictures += work.views_per_step as u64 * KEPT_DISTORTED * large;
    }
    let differentiating = drawn as u64 + kept_pictures;
    let preparing = threads * PREPARING * scene.gaussians;
    let optimising = MemoryRequirements {
        models: models.learning,
        scene: scene.bytes(),
        offsets: work.marks * (2 * learned + if scene.exact { 0 } else { learned } + 9 * scene.gaussians),
        optimiser: work.marks * (2 * learned + 4 * scene.gaussians),
        views: (kept + in_hand + held_out) as u64 + GEOMETRY_OF_VIEWS * scene.gaussians,
        // Views are prepared while a step is computed.
        pictures: differentiating + preparing,
        ..MemoryRequirements::of_program()
    };
    // When the marked scene is verified, views and optimiser are gone, and there are two scenes.
    let verifying = MemoryRequirements {
        models: models.verifying,
        scene: 2 * scene.bytes(),
        offsets: optimising.offsets - work.marks * learned,
        pictures: 2 * work.verification_views as u64 * picture + preparing + 2 * GEOMETRY_OF_VIEWS * scene.gaussians,
        ..MemoryRequirements::of_program()
    };
    if optimising.total() >= verifying.total() {
        optimising
    } else {
        verifying
    }
}
