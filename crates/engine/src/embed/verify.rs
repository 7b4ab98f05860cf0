//! Verifies a marked scene as a stranger would see it: 8-bit pictures from held-out views.
use super::settings::Settings;
use super::shown::{APART_DB, Compared, averaged};
use crate::error::{Error, Result};
use crate::extract::{Comparison, Engine, PooledLogits, default_size, read_rendered, stands_for};
use crate::message::Message;
use crate::picture::Picture;
use crate::quality::{Quality, covered};
use crate::scene::Gaussians;
use crate::splat::{Geometry, PreparedView, WeightCache};
use crate::view::{Camera, Split, ViewSampler};

/// What the verification found.
#[derive(Clone, Debug)]
pub struct Verification {
    /// How the views compare with the message: the decision is on its word.
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
    /// How much the mark shows; where views stand badly for larger pictures, in such as are averaged down.
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

/// A view of both scenes.
struct HeldOutView {
    original: PreparedView,
    /// As a picture of its size shows the marked scene.
    marked: PreparedView,
    /// As one that was averaged down does, which is read.
    averaged: PreparedView,
}

/// What it looks like.
struct Seen {
    before: Picture,
    after: Picture,
    /// Pixels that the original covers.
    covered: Vec<bool>,
    /// Logits that are read of the marked scene.
    read: Vec<f32>,
}

impl HeldOutView {
    fn prepare(original: &Geometry<'_>, marked: &Geometry<'_>, camera: &Camera) -> Result<Self> {
        Ok(Self {
            original: original.prepare(camera, WeightCache::None)?,
            marked: marked.prepare(camera, WeightCache::None)?,
            averaged: marked.prepare_averaged(camera, stands_for(camera.width), WeightCache::None)?,
        })
    }

    fn look(views: &[Self], engine: &Engine, original: &Geometry<'_>, marked: &Geometry<'_>) -> Result<Vec<Seen>> {
        let [white, black] = [[1.0; 3], [0.0; 3]];
        let of = |part: fn(&Self) -> &PreparedView| views.iter().map(part).collect::<Vec<_>>();
        let originals = of(|view| &view.original);
        let before = engine.drawn(original, &originals, white)?;
        let on_black = engine.drawn(original, &originals, black)?;
        let after = engine.drawn(marked, &of(|view| &view.marked), white)?;
        let averaged = engine.drawn(marked, &of(|view| &view.averaged), white)?;
        let read = read_rendered(engine, &averaged)?;
        let pictures = before.into_iter().zip(on_black).zip(after.into_iter().zip(read));
        let seen = |((before, on_black), (after, read)): ((Picture, Picture), (Picture, Vec<f32>))| {
            Ok(Seen {
                covered: covered(&before, &on_black)?,
                after,
                read,
                before,
            })
        };
        pictures.map(seen).collect()
    }
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
    let (views, size) = (
        settings.verify.views,
        settings.verify.size.unwrap_or_else(|| default_size(engine)),
    );
    // From the original, so that both scenes are seen by the same cameras whatever happened to the other.
    let sampler = ViewSampler::seen_from(original, settings.seed, settings.viewpoints(cameras))?;
    let [original, marked] = [original, marked].map(Geometry::new);
    let mut compared = Compared::default();
    let mut logits = Vec::with_capacity(views);
    engine.each_view(
        original.len() + marked.len(),
        views,
        |index| {
            let camera = sampler.camera(Split::HeldOut, index as u64, size);
            HeldOutView::prepare(&original, &marked, &camera)
        },
        |views| HeldOutView::look(views, engine, &original, &marked),
        |index, seen| {
            logits.push(seen.read);
            compared.add(seen.before, seen.after, &seen.covered)?;
            done(index + 1);
            Ok(())
        },
    )?;
    let mut shown = compared.shown(engine)?;
    if settings.target.is_too_visible(&shown.quality, shown.psnr_covered_db) {
        let larger = averaged(engine, [&original, &marked], &sampler, views, size)?;
        let psnr = |quality: &Quality| quality.psnr.psnr_db.unwrap_or(f64::INFINITY);
        if psnr(&larger.quality) >= psnr(&shown.quality) + APART_DB {
            shown = larger;
        }
    }
    let reading = PooledLogits::new(logits)?;
    // Rendered as it is, a scene is one hypothesis.
    let code = &engine.message_code;
    let comparison = reading.compare(code, message, &engine.acceptance_rule(1))?;
    let wrong = |read: &PooledLogits| Ok::<_, Error>(code.wrong_bits(&read.summed, message)? as usize);
    let read = reading.of_first(settings.verify.message_views)?;
    let (wrong_bits, wrong_bits_of_all) = (wrong(&read)?, wrong(&reading)?);
    Ok(Verification {
        comparison,
        reading,
        message_recovered: wrong_bits == 0,
        wrong_bits,
        wrong_bits_of_all,
        message: code.read(&read.summed)?,
        quality: shown.quality,
        psnr_covered_db: shown.psnr_covered_db,
        covered: shown.covered,
        views,
        size,
        pairs: shown.pairs,
    })
}
