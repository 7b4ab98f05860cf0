//! Pictures that show how CLIP features vary by themselves: what a key's projection must ignore.
use burn::tensor::Tensor;
use guardsplat_distortion::{Layer, RobustTo};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::clip::Clip;
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::picture::Picture;
use crate::quality::batch;
use crate::sample::sample;
use crate::splat::{Rasterizer, WeightCache, prepare, sh};
use crate::stop::Stop;
use crate::view::{Split, ViewSampler};

/// Pictures given to CLIP at once.
const BATCH: usize = 16;
/// Scenes to render, and views of each.
const SCENES: u64 = 16;
const VIEWS: u64 = 8;
/// Gaussians of a scene; enough for views without holes.
const GAUSSIANS: usize = 20_000;
/// Background colour of the corners that rotations uncover.
const CORNERS: [f32; 3] = [1.0; 3];
/// The seed of the first scene; users begin at 0, and their own sample scene should not be among these.
const FIRST_SEED: u64 = 0x6e61_7475_7265;

/// Views of sample scenes of `size` x `size` pixels, a quarter of them over black.
///
/// # Errors
/// Each picture may fail as rendering does.
pub fn pictures(rasterizer: Box<dyn Rasterizer>, size: u32) -> Result<impl Iterator<Item = Result<Picture>>> {
    let scenes = (0..SCENES)
        .map(|index| {
            let scene = sample(GAUSSIANS, 3, FIRST_SEED + index)?.gaussians;
            let sampler = ViewSampler::around(&scene, index)?;
            Ok((scene, sampler))
        })
        .collect::<Result<Vec<_>>>()?;
    let views = (0..SCENES as usize).flat_map(|scene| (0..VIEWS).map(move |view| (scene, view)));
    Ok(views.map(move |(scene, index)| {
        let (scene, sampler) = &scenes[scene];
        let camera = sampler.camera(Split::Training, index, size);
        let view = prepare(scene, &camera, WeightCache::None)?;
        let background = if index % 4 == 0 { [0.0; 3] } else { [1.0; 3] };
        let colours = sh::colours(&scene.sh, None, &view);
        Ok(rasterizer.render(&view, &colours, background)?.to_8_bit())
    }))
}

/// How many pictures [`pictures`] gives.
pub fn count() -> usize {
    (SCENES * VIEWS) as usize
}

/// CLIP features of pictures of one size, `[n][dim]` row-major; after those of some pictures come those of the same ones
/// distorted in the ways of `robust_to`, if there are any. `done` hears of how many pictures there are features.
///
/// # Errors
/// The first of the pictures', a failing device, or [`Error::Stopped`].
pub fn features(
    clip: &Clip,
    compute: &Compute,
    pictures: impl Iterator<Item = Result<Picture>>,
    robust_to: RobustTo,
    stop: &Stop,
    mut done: impl FnMut(usize),
) -> Result<Vec<f32>> {
    let layer = Layer {
        robust_to,
        ..Layer::default()
    };
    let distorted = robust_to.of_pictures().next().is_some();
    let mut rng = ChaCha8Rng::seed_from_u64(FIRST_SEED);
    let mut features = Vec::new();
    let mut read_pictures = 0;
    let mut waiting: Vec<Picture> = Vec::with_capacity(BATCH);
    let mut read = |waiting: &mut Vec<Picture>| -> Result<()> {
        if waiting.is_empty() {
            return Ok(());
        }
        let pictures = batch(&waiting.iter().collect::<Vec<_>>(), &compute.device)?;
        let mut extend = |pictures: Tensor<4>| -> Result<()> {
            let rows = clip.image_features(pictures).try_into_vec_as::<f32>();
            features.extend(rows.map_err(|e| Error::Device {
                device: compute.name.clone(),
                reason: e.to_string(),
            })?);
            Ok(())
        };
        extend(pictures.clone())?;
        if distorted {
            extend(layer.apply(pictures, CORNERS, &mut rng))?;
        }
        read_pictures += waiting.len();
        waiting.clear();
        done(read_pictures);
        Ok(())
    };
    for picture in pictures {
        stop.check()?;
        waiting.push(picture?);
        if waiting.len() == BATCH {
            read(&mut waiting)?;
        }
    }
    read(&mut waiting)?;
    Ok(features)
}
