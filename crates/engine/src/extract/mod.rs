//! Extraction: reads a message from pictures of a scene, or from a scene by rendering it over the sphere.
mod blind;
mod engine;
mod extractor;
mod hypothesis;
mod led;
mod linear;
mod photometric;
mod picture_logits;
mod pictures;
mod pooled;
mod registration;
mod restore;
mod sizes;
mod suspect_kind;
mod view_size;
mod views;
mod window;

pub use blind::Candidate;
pub(crate) use engine::cpu_weight_cache;
pub use engine::{Engine, rasterizer};
pub use extractor::{ClipExtractor, Extractor, HiddenExtractor};
pub use hypothesis::{searched_hypotheses, without_borders};
pub use photometric::{corrections, read_corrections};
pub use picture_logits::{PictureLogits, estimates, hypotheses};
pub use pictures::{MAX_PICTURES, Source, find_source};
pub use pooled::{Comparison, PooledLogits};
pub use registration::{MATCHED_FILTER_BYTES, Original, RegisteredPicture, Registration};
pub use restore::{StaticBackground, read_given, read_rendered};
pub use suspect_kind::SuspectKind;
pub(crate) use view_size::sufficient_side;
pub use view_size::{likeness_to_finer, size_for_scene};

use crate::error::Result;
use crate::picture::Picture;
use crate::scene::Gaussians;
use crate::splat::{Geometry, WeightCache};
use crate::view::{Split, ViewSampler};

/// Views that a scene is read from where nothing else is asked for.
pub const DEFAULT_VIEWS: usize = 20;

/// Side of views in pixels where nothing else is asked for: what the extractor takes in, between 128 and 512. The presets
/// train at the shipped CLIP's size, and a mark is read best at the size it was trained at. Scenes of fine splats, and
/// views of which each shows another part, take twice that ([`size_for_scene`]).
pub fn default_size(engine: &Engine) -> u32 {
    engine.extractor.side().clamp(128, 512) as u32
}

/// Side in pixels of pictures as people make them of scenes. They are averaged down before they are read, and show finer
/// detail then than a picture that was drawn as small.
const PEOPLES_SIDE: f32 = 800.0;

/// How much larger than a view of so many pixels the picture is that it stands for where it is read.
pub(crate) fn stands_for(side: u32) -> f32 {
    (PEOPLES_SIDE / side.max(1) as f32).max(1.0)
}

/// Reads pictures that somebody gave, whatever their sizes.
///
/// # Errors
/// No pictures, or a failing device.
pub fn read_pictures(engine: &Engine, pictures: &[Picture]) -> Result<PooledLogits> {
    let logits = pictures.iter().map(|picture| read_given(engine, picture));
    PooledLogits::new(logits.collect::<Result<_>>()?)
}

/// Renders `views` held-out 8-bit views of a scene as `sampler` has them, `size` by `size` pixels, and reads them. Each
/// stands for a picture of 800 px averaged down, where it is smaller, at its own cost. `done` hears of every view, and is
/// shown it.
///
/// # Errors
/// A size out of range, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub fn read_scene(
    engine: &Engine,
    gaussians: &Gaussians,
    sampler: &ViewSampler,
    views: usize,
    size: u32,
    background: [f32; 3],
    mut done: impl FnMut(usize, &Picture) -> Result<()>,
) -> Result<PooledLogits> {
    let geometry = Geometry::new(gaussians);
    let mut logits = Vec::with_capacity(views);
    engine.each_view(
        gaussians.len(),
        views,
        |index| {
            let camera = sampler.camera(Split::HeldOut, index as u64, size);
            geometry.prepare_averaged(&camera, stands_for(size), WeightCache::None)
        },
        |views| {
            let pictures = engine.drawn(&geometry, &views.iter().collect::<Vec<_>>(), background)?;
            let read = read_rendered(engine, &pictures)?;
            Ok(read.into_iter().zip(pictures).collect())
        },
        |index, (read, picture)| {
            logits.push(read);
            done(index + 1, &picture)
        },
    )?;
    PooledLogits::new(logits)
}
