//! Sample scenes seen from several views: what the head is fitted to. Two of three are made fainter, because a scene of a
//! few smooth colours varies from view to view more than a colourful one does; all can be roughened
//! ([`super::roughness`]).
use super::roughness::{degree, roughen};
use super::{IMAGE_SIZE, TrainOptions};
use crate::error::Result;
use crate::picture::Picture;
use crate::sample::sample;
use crate::scene::Gaussians;
use crate::splat::{Geometry, PreparedView, Rasterizer, WeightCache, sh};
use crate::view::{Split, ViewSampler};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Gaussians of a scene; enough for views without holes at this size.
const GAUSSIANS: usize = 6000;
/// Least contrast of a scene that is made fainter.
const LEAST_CONTRAST: f32 = 0.15;
/// How far its mean colour moves at most, at no contrast, as a DC coefficient.
const LARGEST_SHIFT: f32 = 1.2;
/// Scenes of different training seeds do not meet, nor those that users make, which begin at 0.
const FIRST_SEED: u64 = 0x7363_656e_6573;

/// Draws for contrast are none of the scene's own.
const CONTRAST_STREAM: u64 = 77;

/// Nor are those for roughness.
const ROUGHNESS_STREAM: u64 = 79;

/// Nor are those for grain.
const GRAIN_STREAM: u64 = 78;

/// A scene and views of it.
pub(super) struct ViewedScene {
    pub gaussians: Gaussians,
    pub views: Vec<PreparedView>,
}

impl ViewedScene {
    /// Scene `index` of the stream of the options' seed, as rough as they say, from so many views, with uniform noise of
    /// up to `grain` on its constant coefficients.
    pub fn new(options: &TrainOptions, index: u64, views: usize, grain: f32) -> Result<Self> {
        let stream = options.seed.wrapping_mul(1 << 20);
        let seed = FIRST_SEED.wrapping_add(stream).wrapping_add(index);
        let rough = options.roughness > 0.0;
        let degree = if rough { degree(index) } else { (index % 4) as usize };
        let mut gaussians = sample(GAUSSIANS, degree, seed)?.gaussians;
        if !index.is_multiple_of(3) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed ^ CONTRAST_STREAM);
            fade(&mut gaussians, &mut rng);
        }
        if rough {
            let mut rng = ChaCha8Rng::seed_from_u64(seed ^ ROUGHNESS_STREAM);
            roughen(&mut gaussians, options.roughness, &mut rng);
        }
        if grain > 0.0 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed ^ GRAIN_STREAM);
            let stride = gaussians.sh.per_gaussian();
            for row in gaussians.sh.coefficients.chunks_exact_mut(stride) {
                row[..3]
                    .iter_mut()
                    .for_each(|v| *v += grain * rng.random_range(-1.0..1.0_f32));
            }
        }
        let sampler = ViewSampler::around(&gaussians, seed)?;
        let geometry = Geometry::new(&gaussians);
        let views = (0..views as u64)
            .into_par_iter()
            .map(|view| {
                let camera = sampler.camera(Split::Training, view, IMAGE_SIZE as u32);
                geometry.prepare(&camera, WeightCache::Weights)
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

/// Lowers the contrast of a scene by a random factor, around its mean colour, which moves too.
fn fade(gaussians: &mut Gaussians, rng: &mut ChaCha8Rng) {
    let contrast = LEAST_CONTRAST * (1.0 / LEAST_CONTRAST).powf(rng.random());
    let rows = gaussians.len() as f32;
    let stride = gaussians.sh.per_gaussian();
    let mut mean = [0.0_f32; 3];
    for row in gaussians.sh.coefficients.chunks_exact(stride) {
        mean.iter_mut().zip(row).for_each(|(m, v)| *m += v / rows);
    }
    let shift = mean.map(|m| (1.0 - contrast) * (m + LARGEST_SHIFT * rng.random_range(-1.0..1.0_f32)));
    for row in gaussians.sh.coefficients.chunks_exact_mut(stride) {
        row.iter_mut().for_each(|v| *v *= contrast);
        row.iter_mut().zip(shift).for_each(|(v, shift)| *v += shift);
    }
}
