//! How large a scene's views have to be drawn to show what larger pictures of it show.
//!
//! A view that stands for a larger picture ([`Geometry::prepare_averaged`]) takes every splat for even over a pixel. Where
//! many fine splats share one, each then lets what is behind shine through, and the view has other colours than the
//! picture has: a mark in these is not one in those.
use super::{default_size, stands_for};
use crate::error::Result;
use crate::extract::Engine;
use crate::picture::Picture;
use crate::quality::{Psnr, covered, mean_psnr, psnr_covered};
use crate::splat::{CpuRasterizer, Geometry, Rasterizer, WeightCache, sh};
use crate::view::{Split, ViewSampler};
use rayon::prelude::*;

/// Held-out views that are compared.
const VIEWS: u64 = 2;
/// Views that are less like finer ones than this, over what the scene covers, are too coarse, dB. A mark has 33 dB there,
/// but what many views have alike is not lost to it: at 160 px the guitar (24 to 29 dB) and the biker (28 to 30) lose, and
/// playbot_31k (32 to 34) does not; playbot_125k has 30 to 31, plant 31 to 37, pod 45, donut 38, samples 34 to 47.
const ALIKE_DB: f64 = 31.0;

/// Side at which views of a scene are read where nothing else is asked for: [`default_size`], or twice that.
///
/// # Errors
/// Those of [`sufficient_side`].
pub fn size_for_scene(engine: &Engine, geometry: &Geometry<'_>, sampler: &ViewSampler) -> Result<u32> {
    sufficient_side(geometry, sampler, default_size(engine))
}

/// `side`, or twice that where views of `side` pixels are too coarse for the scene, or each shows another part of it: then
/// few views show a surface, and more pixels of it make up for that. The same on every device.
///
/// # Errors
/// A side or cameras out of range.
pub(crate) fn sufficient_side(geometry: &Geometry<'_>, sampler: &ViewSampler, side: u32) -> Result<u32> {
    if sampler.shows_parts() {
        return Ok(2 * side);
    }
    let likeness = likeness_to_finer(geometry, sampler, side)?;
    Ok(if likeness < ALIKE_DB { 2 * side } else { side })
}

/// How alike views of `side` pixels are to those of twice the side, averaged down: PSNR over what the scene covers, dB.
/// Infinite where there is no difference, or nothing to be seen.
///
/// # Errors
/// A side or cameras out of range.
pub fn likeness_to_finer(geometry: &Geometry<'_>, sampler: &ViewSampler, side: u32) -> Result<f64> {
    let draw = |index: u64, side: u32, grounds: &[f32]| -> Result<Vec<Picture>> {
        let camera = sampler.camera(Split::HeldOut, index, side);
        let view = geometry.prepare_averaged(&camera, stands_for(side), WeightCache::None)?;
        let colours = sh::colours(geometry.sh(), None, &view);
        let over = |ground: &f32| CpuRasterizer.render(&view, &colours, [*ground; 3]);
        grounds.iter().map(over).collect()
    };
    let compared = |index: u64| -> Result<Option<Psnr>> {
        let (coarse, fine) = (draw(index, side, &[1.0, 0.0])?, draw(index, 2 * side, &[1.0])?);
        let mask = covered(&coarse[0], &coarse[1])?;
        psnr_covered(&halved(&fine[0]), &coarse[0], &mask)
    };
    let compared: Vec<Option<Psnr>> = (0..VIEWS).into_par_iter().map(compared).collect::<Result<_>>()?;
    let differences: Vec<Psnr> = compared.into_iter().flatten().collect();
    if differences.is_empty() {
        return Ok(f64::INFINITY);
    }
    Ok(mean_psnr(&differences)?.psnr_db.unwrap_or(f64::INFINITY))
}

/// The picture averaged down to half its side.
fn halved(picture: &Picture) -> Picture {
    let (width, height) = (picture.width / 2, picture.height / 2);
    let row = 3 * picture.width as usize;
    let mut pixels = Vec::with_capacity(3 * (width * height) as usize);
    for y in 0..height as usize {
        for x in 0..width as usize {
            let at = 2 * y * row + 6 * x;
            let mean = |channel: usize| {
                let of = |offset: usize| picture.pixels[at + offset + channel].clamp(0.0, 1.0);
                (of(0) + of(3) + of(row) + of(row + 3)) / 4.0
            };
            pixels.extend([0, 1, 2].map(mean));
        }
    }
    Picture { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::sample;
    use crate::view::Viewpoints;

    #[test]
    fn four_pixels_become_one() {
        let picture = Picture {
            width: 4,
            height: 2,
            pixels: (0..8).flat_map(|i| [i as f32 / 8.0, 0.5, 2.0]).collect(),
        };
        let half = halved(&picture);
        assert_eq!((half.width, half.height), (2, 1));
        // Pixels 0, 1, 4, 5 and 2, 3, 6, 7; nothing is brighter than white.
        assert_eq!(half.pixels, [2.5 / 8.0, 0.5, 1.0, 4.5 / 8.0, 0.5, 1.0]);
    }

    /// Samples of more Gaussians have smaller ones.
    #[test]
    fn scenes_of_fine_splats_need_larger_views() {
        let side = |gaussians: usize| {
            let scene = sample(gaussians, 0, 3).unwrap().gaussians;
            let sampler = ViewSampler::new(&scene, 1).unwrap();
            sufficient_side(&Geometry::new(&scene), &sampler, 40).unwrap()
        };
        assert_eq!([side(300), side(20_000)], [40, 80]);
    }

    #[test]
    fn views_of_parts_of_a_scene_are_larger() {
        let scene = sample(300, 0, 3).unwrap().gaussians;
        let around = ViewSampler::new(&scene, 1).unwrap();
        let cameras = [0, 1, 2].map(|index| around.camera(Split::Training, index, 40));
        let given = ViewSampler::seen_from(
            &scene,
            1,
            Viewpoints {
                kind: None,
                cameras: &cameras,
            },
        );
        let side = |sampler: &ViewSampler| sufficient_side(&Geometry::new(&scene), sampler, 40).unwrap();
        assert_eq!([side(&around), side(&given.unwrap())], [40, 80]);
    }
}
