//! Sample scenes seen from several views: what the head is fitted to.
use super::IMAGE_SIZE;
use crate::error::Result;
use crate::picture::Picture;
use crate::sample::sample;
use crate::scene::Gaussians;
use crate::splat::{PreparedView, Rasterizer, WeightCache, prepare, sh};
use crate::view::{Split, ViewSampler};
use rayon::prelude::*;

/// Gaussians of a scene; enough for views without holes at this size.
const GAUSSIANS: usize = 6000;
/// Scenes of different training seeds do not meet, nor those that users make, which begin at 0.
const FIRST_SEED: u64 = 0x7363_656e_6573;

/// A scene and views of it.
pub(super) struct ViewedScene {
    pub gaussians: Gaussians,
    pub views: Vec<PreparedView>,
}

impl ViewedScene {
    /// Scene `index` of the stream of `seed`, from so many views.
    pub fn new(seed: u64, index: u64, views: usize) -> Result<Self> {
        let seed = FIRST_SEED.wrapping_add(seed.wrapping_mul(1 << 20)).wrapping_add(index);
        let gaussians = sample(GAUSSIANS, (index % 4) as usize, seed)?.gaussians;
        let sampler = ViewSampler::new(&gaussians, seed)?;
        let views = (0..views as u64)
            .into_par_iter()
            .map(|view| {
                let camera = sampler.camera(Split::Training, view, IMAGE_SIZE as u32);
                prepare(&gaussians, &camera, WeightCache::Weights)
            })
            .collect::<Result<_>>()?;
        Ok(Self { gaussians, views })
    }

    /// A view's picture over a grey of this level, values cut to [0, 1].
    pub fn picture(&self, rasterizer: &dyn Rasterizer, view: &PreparedView, ground: f32) -> Result<Picture> {
        let colours = sh::colours(&self.gaussians.sh, None, view);
        let mut picture = rasterizer.render(view, &colours, [ground; 3])?;
        picture.pixels.iter_mut().for_each(|v| *v = v.clamp(0.0, 1.0));
        Ok(picture)
    }
}
