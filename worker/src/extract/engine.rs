//! The parts that embedding and extraction share: device, CLIP, a key's decoder and the renderer.
use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::clip::Clip;
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::message::{Key, Reader};
use crate::picture::Picture;
use crate::quality::{Lpips, batch};
use crate::scene::Gaussians;
use crate::splat::{CpuRasterizer, GpuRasterizer, Rasterizer, WeightCache, prepare, sh};
use crate::stop::Stop;
use crate::view::Camera;

/// Pictures given to CLIP at once when no gradient is needed.
const READ_BATCH: usize = 16;
/// Side in pixels up to which a view's weights are worth keeping: 512 squared are some 100 MB.
const CACHED_SIDE: u32 = 512;

/// The renderer for a device.
///
/// # Errors
/// When the device cannot render.
pub fn rasterizer(compute: &Compute) -> Result<Box<dyn Rasterizer>> {
    Ok(if on_cpu(compute) {
        Box::new(CpuRasterizer)
    } else {
        Box::new(GpuRasterizer::new(&compute.device)?)
    })
}

fn on_cpu(compute: &Compute) -> bool {
    compute.name == "cpu"
}

/// Everything that is loaded once and used for any number of scenes.
pub struct Engine {
    /// Where tensors live.
    pub compute: Compute,
    /// The frozen CLIP.
    pub clip: Clip,
    /// The key's projection and decoder.
    pub reader: Reader,
    /// Bits of the key's messages.
    pub bits: usize,
    /// The renderer.
    pub rasterizer: Box<dyn Rasterizer>,
    /// Perceptual distance, where its weights are.
    pub lpips: Option<Lpips>,
    /// Ends whatever is being computed, with [`Error::Stopped`](crate::Error::Stopped).
    pub stop: Stop,
}

impl Engine {
    /// Puts a CLIP and a key together. That they belong to each other is for the caller to check
    /// ([`Key::require_clip`]), who knows their files.
    ///
    /// # Errors
    /// When the device cannot render, or features and decoder differ in width.
    pub fn new(compute: Compute, clip: Clip, key: &Key, lpips: Option<Lpips>) -> Result<Self> {
        if clip.dim() != key.projection.width {
            return Err(Error::BadModel {
                name: key.clip.name.clone(),
                reason: format!(
                    "its features have {} dimensions, the key reads {}",
                    clip.dim(),
                    key.projection.width
                ),
            });
        }
        Ok(Self {
            rasterizer: rasterizer(&compute)?,
            reader: key.reader(&compute.device),
            bits: key.bits(),
            compute,
            clip,
            lpips,
            stop: Stop::default(),
        })
    }

    /// Logits `[b, bits]` of pictures `[b, 3, h, w]` in [0, 1]; differentiable in the pictures.
    pub fn logits(&self, pictures: Tensor<4>) -> Tensor<2> {
        self.reader.image_logits(self.clip.image_features(pictures))
    }

    /// Logits of each picture, `bits` numbers a picture. Sizes may differ.
    ///
    /// # Errors
    /// Pictures without pixels, a failing device, or [`Error::Stopped`].
    pub fn read_logits(&self, pictures: &[Picture]) -> Result<Vec<Vec<f32>>> {
        let mut rows = Vec::with_capacity(pictures.len());
        for same in pictures.chunk_by(|a, b| (a.width, a.height) == (b.width, b.height)) {
            for chunk in same.chunks(READ_BATCH) {
                self.stop.check()?;
                let chunk: Vec<&Picture> = chunk.iter().collect();
                let logits = self.logits(batch(&chunk, &self.compute.device)?);
                rows.extend(self.to_host(logits)?.chunks_exact(self.bits).map(<[f32]>::to_vec));
            }
        }
        Ok(rows)
    }

    /// Values of a tensor on the host.
    ///
    /// # Errors
    /// When the device fails.
    pub fn to_host<const D: usize>(&self, tensor: Tensor<D>) -> Result<Vec<f32>> {
        tensor.try_into_vec_as::<f32>().map_err(|e| Error::Device {
            device: self.compute.name.clone(),
            reason: e.to_string(),
        })
    }

    /// What a view that is drawn repeatedly keeps: weights where they are used and fit.
    pub fn weight_cache(&self, size: u32) -> WeightCache {
        if on_cpu(&self.compute) && size <= CACHED_SIDE {
            WeightCache::Weights
        } else {
            WeightCache::None
        }
    }

    /// The 8-bit picture of a view that is drawn once.
    ///
    /// # Errors
    /// Those of [`prepare`] and of the renderer; [`Error::Stopped`].
    pub fn picture(&self, gaussians: &Gaussians, camera: &Camera, background: [f32; 3]) -> Result<Picture> {
        self.stop.check()?;
        let view = prepare(gaussians, camera, WeightCache::None)?;
        let colours = sh::colours(&gaussians.sh, None, &view);
        Ok(self.rasterizer.render(&view, &colours, background)?.to_8_bit())
    }

    /// `work` on each item, in order. On the CPU items run side by side; a GPU has one queue, and waiting for it on
    /// the threads of a pool could block them all.
    ///
    /// # Errors
    /// The first of `work`; [`Error::Stopped`], which is looked at before each item.
    pub fn each<I: Sync, O: Send>(&self, items: &[I], work: impl Fn(&I) -> Result<O> + Send + Sync) -> Result<Vec<O>> {
        let work = |item: &I| {
            self.stop.check()?;
            work(item)
        };
        if on_cpu(&self.compute) {
            items.par_iter().map(work).collect()
        } else {
            items.iter().map(work).collect()
        }
    }
}
