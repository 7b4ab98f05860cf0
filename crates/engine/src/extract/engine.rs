//! The parts that embedding and extraction share: device, what reads messages from pictures, and the renderer.
use std::borrow::Borrow;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::OnceLock;

use burn::tensor::Tensor;
use guardsplat_codeword::{AcceptanceRule, DEFAULT_FALSE_POSITIVE_RATE, MessageCode};
use rayon::prelude::*;

use super::extractor::{ClipExtractor, Extractor};
use super::hypothesis::searched_hypotheses;
use super::sizes::larger_sides;
use crate::clip::{Clip, WeightedColours};
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::memory::Limits;
use crate::message::Key;
use crate::picture::Picture;
use crate::quality::{Lpips, batch};
use crate::resize::{resize, resized, resized_part};
use crate::splat::{CpuRasterizer, Geometry, GpuRasterizer, Rasterizer, WeightCache, sh};
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

/// What a view of that side keeps on the CPU: weights where they fit, in `half` precision if asked for.
pub(crate) fn cpu_weight_cache(side: u32, half: bool) -> WeightCache {
    match side <= CACHED_SIDE {
        true if half => WeightCache::HalfWeights,
        true => WeightCache::Weights,
        false => WeightCache::None,
    }
}

/// Everything that is loaded once and used for any number of scenes.
pub struct Engine {
    /// Where tensors live.
    pub compute: Compute,
    /// What reads messages from pictures.
    pub extractor: Box<dyn Extractor>,
    /// Bits of what is embedded and read: logits of a picture.
    pub bits: usize,
    /// How the key's messages become what is embedded.
    pub message_code: MessageCode,
    /// The renderer, from its first use on: pictures are read without it.
    rasterizer: OnceLock<Box<dyn Rasterizer>>,
    /// Where the weights of the perceptual distance are, if they were added.
    lpips_weights: Option<PathBuf>,
    /// The perceptual distance, from its first use on.
    lpips: OnceLock<Lpips>,
    /// How often a match may be claimed wrongly: of what is read, and by the claims that a mark is to bear.
    pub false_positive_rate: f64,
    /// What a job may take of the machine's memory.
    pub limits: Limits,
    /// Ends whatever is being computed, with [`Error::Stopped`](crate::Error::Stopped).
    pub stop: Stop,
}

impl Engine {
    /// Puts a CLIP and a key together. That they belong to each other is for the caller to check
    /// ([`Key::require_clip`]), who knows their files.
    ///
    /// # Errors
    /// Those of [`ClipExtractor::new`], and of [`Key::message_code`].
    pub fn new(compute: Compute, clip: Clip, key: &Key, lpips_weights: Option<PathBuf>) -> Result<Self> {
        let extractor = ClipExtractor::new(clip, key, &compute.device)?;
        Ok(Self {
            message_code: key.message_code()?,
            ..Self::with_extractor(compute, Box::new(extractor), lpips_weights)
        })
    }

    /// An engine that reads with any extractor, whose weights are on the device of `compute`. Messages are embedded bit by bit.
    pub fn with_extractor(compute: Compute, extractor: Box<dyn Extractor>, lpips_weights: Option<PathBuf>) -> Self {
        Self {
            rasterizer: OnceLock::new(),
            bits: extractor.bits(),
            message_code: MessageCode::Plain,
            extractor,
            false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
            limits: Limits {
                buffer: compute.max_buffer,
                ..Limits::of_machine(None)
            },
            compute,
            lpips_weights,
            lpips: OnceLock::new(),
            stop: Stop::default(),
        }
    }

    /// The rule by which a reading is judged that is the best of so many.
    pub fn acceptance_rule(&self, hypotheses: usize) -> AcceptanceRule {
        AcceptanceRule {
            false_positive_rate: self.false_positive_rate,
            hypotheses: hypotheses as u64,
        }
    }

    /// The rule by which a claim is judged that names one asset and shows one picture: it pays for every hypothesis that
    /// this engine searches.
    pub fn claim_rule(&self) -> AcceptanceRule {
        self.acceptance_rule(searched_hypotheses(self.extractor.as_ref()).len())
    }

    /// The renderer.
    ///
    /// # Errors
    /// When the device cannot render.
    pub fn rasterizer(&self) -> Result<&dyn Rasterizer> {
        if self.rasterizer.get().is_none() {
            // Another thread may have been faster, which is as good.
            let _ = self.rasterizer.set(rasterizer(&self.compute)?);
        }
        self.rasterizer.get().map(AsRef::as_ref).ok_or_else(|| Error::Device {
            device: self.compute.name.clone(),
            reason: "the renderer could not be made".into(),
        })
    }

    /// Whether the weights of the perceptual distance were added.
    pub fn has_lpips(&self) -> bool {
        self.lpips_weights.is_some()
    }

    /// The perceptual distance, where its weights were added. They are read at the first call.
    ///
    /// # Errors
    /// When the weights are not those that are expected.
    pub fn lpips(&self) -> Result<Option<&Lpips>> {
        let Some(path) = &self.lpips_weights else {
            return Ok(None);
        };
        if self.lpips.get().is_none() {
            let _ = self.lpips.set(Lpips::load(path, &self.compute.device)?);
        }
        Ok(self.lpips.get())
    }

    /// Whether tensors live in the host's memory, where loops of our own reach them.
    pub(crate) fn on_cpu(&self) -> bool {
        on_cpu(&self.compute)
    }

    /// Bytes of the weights of all models that a job uses; `with_lpips` says whether that is one of them.
    pub fn model_bytes(&self, with_lpips: bool) -> u64 {
        let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |file| file.len());
        let lpips = self.lpips_weights.as_ref().filter(|_| with_lpips).map_or(0, size);
        4 * self.extractor.parameters() as u64 + lpips
    }

    /// Logits `[b, bits]` of pictures `[b, 3, h, w]` in [0, 1]; differentiable in the pictures.
    ///
    /// # Errors
    /// Those of the extractor.
    pub fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        self.extractor.logits(pictures)
    }

    /// Sides at which a square picture of that many `pixels` a side is read: the extractor's own, and [`larger_sides`].
    pub fn sides(&self, pixels: usize) -> Vec<usize> {
        let extractor = self.extractor.as_ref();
        std::iter::once(extractor.side())
            .chain(larger_sides(extractor, pixels))
            .collect()
    }

    /// [`Engine::logits`] of square pictures `[b, 3, n, n]` made `side` pixels wide and high, one of [`Engine::sides`].
    ///
    /// # Errors
    /// Those of the extractor.
    pub fn logits_at(&self, side: usize, pictures: Tensor<4>) -> Result<Tensor<2>> {
        if side == self.extractor.side() {
            return self.logits(pictures);
        }
        self.extractor.square_logits(resize(pictures, side, side))
    }

    /// Logits of each picture, `bits` numbers a picture. Sizes may differ.
    ///
    /// # Errors
    /// Pictures without pixels, a failing device, or [`Error::Stopped`].
    pub fn read_logits(&self, pictures: &[Picture]) -> Result<Vec<Vec<f32>>> {
        let side = self.extractor.side();
        self.read_with(pictures, side, |pictures| self.logits(pictures))
    }

    /// Logits of pictures that have these colours, a histogram for each of the extractor's scales.
    ///
    /// # Errors
    /// Those of [`Extractor::colour_logits`].
    pub(super) fn read_colours(&self, pictures: &[Vec<WeightedColours>]) -> Result<Vec<Vec<f32>>> {
        if pictures.is_empty() {
            return Ok(Vec::new());
        }
        let logits = self.to_host(self.extractor.colour_logits(pictures)?)?;
        Ok(logits.chunks_exact(self.bits).map(<[f32]>::to_vec).collect())
    }

    /// Logits of pictures that are made `side` pixels wide and high first: the extractor's own side, or another one where
    /// it looks at squares one by one.
    ///
    /// # Errors
    /// Those of [`Engine::read_logits`].
    pub(super) fn read_logits_at<P: Borrow<Picture> + Sync>(
        &self,
        side: usize,
        pictures: &[P],
    ) -> Result<Vec<Vec<f32>>> {
        self.read_with(pictures, side, |pictures| self.logits_at(side, pictures))
    }

    /// Logits of pictures, which are made `side` pixels wide and high first.
    fn read_with<P: Borrow<Picture> + Sync>(
        &self,
        pictures: &[P],
        side: usize,
        read: impl Fn(Tensor<4>) -> Result<Tensor<2>> + Send + Sync,
    ) -> Result<Vec<Vec<f32>>> {
        let pictures: Vec<&Picture> = pictures.iter().map(Borrow::borrow).collect();
        let alike = pictures.chunk_by(|a, b| (a.width, a.height) == (b.width, b.height));
        let chunks: Vec<&[&Picture]> = alike.flat_map(|alike| alike.chunks(READ_BATCH)).collect();
        let rows = |chunk: &&[&Picture]| {
            let made = match [chunk[0].width, chunk[0].height] == [side as u32; 2] {
                true => Vec::new(),
                false => self.each(chunk, |picture| self.resized_to(side, picture))?,
            };
            let chunk: Vec<&Picture> = match made.is_empty() {
                true => chunk.to_vec(),
                false => made.iter().collect(),
            };
            let logits = self.to_host(read(batch(&chunk, &self.compute.device)?)?)?;
            Ok(logits.chunks_exact(self.bits).map(<[f32]>::to_vec).collect::<Vec<_>>())
        };
        // Packing keeps a tower of sines waiting. Transformers use all cores anyway, and a batch of them fills memory.
        let of_chunks = match self.extractor.reads_exact_colours() {
            true => self.each(&chunks, rows)?,
            false => {
                let one = |chunk| self.stop.check().and_then(|()| rows(chunk));
                chunks.iter().map(one).collect::<Result<Vec<_>>>()?
            }
        };
        Ok(of_chunks.into_iter().flatten().collect())
    }

    /// A picture at the side that the extractor takes in.
    ///
    /// # Errors
    /// A picture without pixels.
    pub fn resized(&self, picture: &Picture) -> Result<Picture> {
        self.resized_to(self.extractor.side(), picture)
    }

    /// A picture made `side` pixels wide and high.
    ///
    /// # Errors
    /// Those of [`Engine::resized`].
    pub(super) fn resized_to(&self, side: usize, picture: &Picture) -> Result<Picture> {
        resized(picture, side, side)
    }

    /// Columns and rows of a picture, at the side that the extractor takes in.
    ///
    /// # Errors
    /// Those of [`Engine::resized`].
    pub(super) fn resized_part(&self, part: [Range<usize>; 2], picture: &Picture) -> Result<Picture> {
        let side = self.extractor.side();
        resized_part(picture, part, side, side)
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

    /// What a view that is drawn repeatedly keeps: weights where they are used and fit, in `half` precision if asked for.
    pub fn weight_cache(&self, size: u32, half: bool) -> WeightCache {
        if self.on_cpu() {
            cpu_weight_cache(size, half)
        } else {
            WeightCache::None
        }
    }

    /// The 8-bit picture of a view that is drawn once.
    ///
    /// # Errors
    /// Those of [`Geometry::prepare`] and of the renderer; [`Error::Stopped`].
    pub fn picture(&self, geometry: &Geometry<'_>, camera: &Camera, background: [f32; 3]) -> Result<Picture> {
        let [picture] = self.pictures(geometry, camera, [background])?;
        Ok(picture)
    }

    /// The 8-bit picture of a view that stands for one `times` as large, averaged down.
    ///
    /// # Errors
    /// Those of [`Engine::picture`].
    pub fn averaged_picture(
        &self,
        geometry: &Geometry<'_>,
        camera: &Camera,
        times: f32,
        background: [f32; 3],
    ) -> Result<Picture> {
        self.stop.check()?;
        let view = geometry.prepare_averaged(camera, times, WeightCache::None)?;
        Ok(self.drawn(geometry, &[&view], background)?.swap_remove(0))
    }

    /// [`Engine::picture`] of one view over each of some backgrounds.
    ///
    /// # Errors
    /// Those of [`Engine::picture`].
    pub fn pictures<const N: usize>(
        &self,
        geometry: &Geometry<'_>,
        camera: &Camera,
        backgrounds: [[f32; 3]; N],
    ) -> Result<[Picture; N]> {
        self.stop.check()?;
        let view = geometry.prepare(camera, WeightCache::None)?;
        let colours = sh::colours(geometry.sh(), None, &view);
        let rasterizer = self.rasterizer()?;
        let mut pictures = backgrounds.map(|_| Picture {
            width: 0,
            height: 0,
            pixels: Vec::new(),
        });
        for (picture, background) in pictures.iter_mut().zip(backgrounds) {
            *picture = rasterizer.render(&view, &colours, background)?.to_8_bit();
        }
        Ok(pictures)
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
        if self.on_cpu() {
            items.par_iter().map(work).collect()
        } else {
            items.iter().map(work).collect()
        }
    }
}
