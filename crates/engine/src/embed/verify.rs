//! Verifies a marked scene as a stranger would see it: 8-bit pictures from held-out views.
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::extract::{Comparison, Engine, PooledLogits, default_size, read_rendered, stands_for};
use crate::message::Message;
use crate::picture::Picture;
use crate::quality::{Psnr, Quality, cover, covered, mean_psnr, measure, psnr_covered};
use crate::scene::Gaussians;
use crate::splat::Geometry;
use crate::view::{Camera, Split, ViewSampler};

/// Pairs of pictures that are kept to look at.
const KEPT_PAIRS: usize = 5;

/// What the verification found.
#[derive(Clone, Debug)]
pub struct Verification {
    /// How the views compare with the message.
    pub comparison: Comparison,
    /// What was read of all views.
    pub reading: PooledLogits,
    /// What was read from the first few views.
    pub message: Message,
    /// Whether that is the whole message.
    pub message_recovered: bool,
    /// Bits of it that are wrong.
    pub wrong_bits: usize,
    /// Bits that are wrong where all views are read together, as a claim reads a scene.
    pub wrong_bits_of_all: usize,
    /// How much the mark shows.
    pub quality: Quality,
    /// Mean PSNR in dB over the pixels that the scene covers; `None` where no view covers any, or none of them differs.
    pub psnr_covered_db: Option<f64>,
    /// Mean share of a view that the scene covers, 0 to 1.
    pub covered: f64,
    /// How many views.
    pub views: usize,
    /// Side of the views in pixels.
    pub size: u32,
    /// Original and marked pictures of the first views.
    pub pairs: Vec<(Picture, Picture)>,
}

/// Renders held-out views of both scenes over white, those of `cameras` if there are any, compares them as they are, and
/// reads them as [`read_scene`](crate::extract::read_scene) does.
///
/// # Errors
/// An empty scene, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub fn verify(
    engine: &Engine,
    original: &Gaussians,
    marked: &Gaussians,
    message: &Message,
    settings: &Settings,
    cameras: &[Camera],
    mut done: impl FnMut(usize),
) -> Result<Verification> {
    let size = settings.verify.size.unwrap_or_else(|| default_size(engine));
    // From the original, so that both scenes are seen by the same cameras whatever happened to the other.
    let sampler = ViewSampler::seen_from(original, settings.seed, settings.viewpoints(cameras))?;
    let [original, marked] = [original, marked].map(Geometry::new);
    let mut pairs = Vec::with_capacity(settings.verify.views);
    let mut logits = Vec::with_capacity(settings.verify.views);
    let (mut of_covered, mut shares): (Vec<Psnr>, f64) = (Vec::new(), 0.0);
    for index in 0..settings.verify.views {
        let camera = sampler.camera(Split::HeldOut, index as u64, size);
        let [before, on_black] = engine.pictures(&original, &camera, [[1.0; 3], [0.0; 3]])?;
        let after = engine.picture(&marked, &camera, [1.0; 3])?;
        let read = engine.averaged_picture(&marked, &camera, stands_for(size), [1.0; 3])?;
        logits.push(read_rendered(engine, &read)?);
        let mask = covered(&before, &on_black)?;
        of_covered.extend(psnr_covered(&before, &after, &mask)?);
        shares += cover::share(&mask);
        pairs.push((before, after));
        done(index + 1);
    }
    let quality = measure(&pairs, engine.lpips()?, &engine.compute.device, &engine.stop)?;
    pairs.truncate(KEPT_PAIRS);
    let reading = PooledLogits::new(logits)?;
    // Rendered as it is, a scene is one hypothesis.
    let comparison = reading.compare(message, &engine.acceptance_rule(1))?;
    let wrong = |read: &PooledLogits| Ok::<_, Error>(message.len() - read.reading().matches(message)? as usize);
    let read = reading.of_first(settings.verify.message_views)?;
    let (wrong_bits, wrong_bits_of_all) = (wrong(&read)?, wrong(&reading)?);
    Ok(Verification {
        comparison,
        reading,
        message_recovered: wrong_bits == 0,
        wrong_bits,
        wrong_bits_of_all,
        message: read.message(),
        quality,
        psnr_covered_db: match of_covered.is_empty() {
            true => None,
            false => mean_psnr(&of_covered)?.psnr_db,
        },
        covered: shares / settings.verify.views.max(1) as f64,
        views: settings.verify.views,
        size,
        pairs,
    })
}
