//! How much a mark shows in held-out views.
//!
//! Views are pictures of their own size. There a splat that is finer than a pixel is widened to one, and one that can be seen
//! through hides the more for it: a scene of glass differs from its mark by 3 dB more at 160 px than in a picture of 800 px.
//! Where views stand for pictures so badly, those count that are averaged down, as training has them.
use crate::error::Result;
use crate::extract::{Engine, stands_for};
use crate::picture::Picture;
use crate::quality::{Psnr, Quality, cover, covered, mean_psnr, measure, psnr_covered};
use crate::splat::{Geometry, PreparedView, WeightCache};
use crate::view::{Split, ViewSampler};

/// Views stand badly for pictures where their PSNR is so much lower than that of averaged ones, dB. Of scenes that cannot be
/// seen through it is within 0.4 of that of pictures of 800 px (docs/evaluation/psnr-views.csv).
pub(super) const APART_DB: f64 = 1.0;

/// Pairs of pictures that are kept to look at.
const KEPT_PAIRS: usize = 5;

/// What a mark changes.
pub(super) struct Shown {
    pub quality: Quality,
    /// Mean PSNR in dB over the pixels that the scene covers; `None` where no view covers any, or none of them differs.
    pub psnr_covered_db: Option<f64>,
    /// Mean share of a view that the scene covers, 0 to 1.
    pub covered: f64,
    /// Original and marked pictures of the first views.
    pub pairs: Vec<(Picture, Picture)>,
}

/// Views of both scenes, as they are compared one by one.
#[derive(Default)]
pub(super) struct Compared {
    pairs: Vec<(Picture, Picture)>,
    of_covered: Vec<Psnr>,
    shares: f64,
}

impl Compared {
    /// Adds a view, of which `covered` are the pixels that the original covers.
    pub fn add(&mut self, before: Picture, after: Picture, covered: &[bool]) -> Result<()> {
        self.of_covered.extend(psnr_covered(&before, &after, covered)?);
        self.shares += cover::share(covered);
        self.pairs.push((before, after));
        Ok(())
    }

    /// What all of them show.
    pub fn shown(mut self, engine: &Engine) -> Result<Shown> {
        let quality = measure(&self.pairs, engine.lpips()?, &engine.compute.device, &engine.stop)?;
        let views = self.pairs.len();
        self.pairs.truncate(KEPT_PAIRS);
        Ok(Shown {
            quality,
            psnr_covered_db: match self.of_covered.is_empty() {
                true => None,
                false => mean_psnr(&self.of_covered)?.psnr_db,
            },
            covered: self.shares / views.max(1) as f64,
            pairs: self.pairs,
        })
    }
}

/// What a mark shows in so many held-out views of `size` pixels that are averaged down from larger pictures.
///
/// # Errors
/// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn averaged(
    engine: &Engine,
    [original, marked]: [&Geometry<'_>; 2],
    sampler: &ViewSampler,
    views: usize,
    size: u32,
) -> Result<Shown> {
    let mut compared = Compared::default();
    engine.each_view(
        original.len() + marked.len(),
        views,
        |index| {
            let camera = sampler.camera(Split::HeldOut, index as u64, size);
            let of = |scene: &Geometry<'_>| scene.prepare_averaged(&camera, stands_for(size), WeightCache::None);
            Ok([of(original)?, of(marked)?])
        },
        |views: &[[PreparedView; 2]]| {
            let [before, after] = [0, 1].map(|which| views.iter().map(|view| &view[which]).collect::<Vec<_>>());
            let on_black = engine.drawn(original, &before, [0.0; 3])?;
            let before = engine.drawn(original, &before, [1.0; 3])?;
            let after = engine.drawn(marked, &after, [1.0; 3])?;
            let pictures = before.into_iter().zip(on_black).zip(after);
            let seen = |((before, on_black), after)| Ok((covered(&before, &on_black)?, before, after));
            pictures.map(seen).collect()
        },
        |_, (covered, before, after)| compared.add(before, after, &covered),
    )?;
    compared.shown(engine)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use crate::embed::run::tests::engine;
    use crate::embed::{Preset, verify};
    use crate::message::Message;
    use crate::sample::sample;
    use crate::scene::Gaussians;

    /// PSNR that a verification tells which asks for `wanted` dB, of changes that are random in each Gaussian.
    fn told(scene: &Gaussians, wanted: f64) -> f64 {
        let mut marked = scene.clone();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        (marked.sh.coefficients.iter_mut()).for_each(|c| *c += 0.3 * (random.random::<f32>() - 0.5));
        let mut settings = Preset::Draft.settings();
        settings.kind = Some(crate::view::SceneKind::Object);
        (settings.verify.views, settings.verify.size) = (3, Some(48));
        (settings.target.psnr_db, settings.target.psnr_covered_db) = (wanted, None);
        let message = Message::parse("6", 4).unwrap();
        let found = verify(&engine(), scene, &marked, &message, &settings, &[], |_| ()).unwrap();
        found.quality.psnr.psnr_db.unwrap()
    }

    #[test]
    fn glass_is_judged_by_what_larger_pictures_show_and_other_scenes_by_their_views() {
        let solid = sample(4000, 0, 3).unwrap().gaussians;
        let mut glass = solid.clone();
        glass.opacity_logits.fill(-2.0);
        glass.log_scales.iter_mut().flatten().for_each(|s| *s -= 1.5);
        // Nothing is missed where nothing is asked.
        let [[as_views, as_pictures], [opaque, judged]] = [&glass, &solid].map(|s| [0.0, 200.0].map(|db| told(s, db)));
        assert!(as_pictures > as_views + super::APART_DB, "{as_views} {as_pictures}");
        assert_eq!(opaque, judged);
    }
}
