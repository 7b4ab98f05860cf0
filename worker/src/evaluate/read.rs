//! Views of a scene as 8-bit pictures, and what is read of them after something was done to them.
use std::collections::BTreeMap;

use guardsplat_codeword::Message;
use guardsplat_distortion::Vae;
use guardsplat_evaluation::attack::Attack;
use guardsplat_evaluation::report::names;
use guardsplat_evaluation::report::record::{Id, ReadingRecord};
use image::RgbImage;

use super::view_readings::ViewReadings;
use crate::error::{Error, Result};
use guardsplat_engine::extract::{Engine, PictureLogits, PooledLogits, read_rendered};
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::{batch, mean_psnr, psnr, unbatch};
use guardsplat_engine::scene::Gaussians;
use guardsplat_engine::splat::Geometry;
use guardsplat_engine::view::{Camera, Split, ViewSampler};

/// Numbers of views from which the whole message is read.
const MESSAGE_VIEWS: [u32; 3] = [1, 5, 10];

/// A camera, and how high it stands over the scene's horizon in degrees.
#[derive(Clone, Debug)]
pub(super) struct HeldOutCamera {
    pub camera: Camera,
    pub elevation: f32,
}

/// Held-out cameras around a scene, by their numbers.
pub(super) fn cameras(
    gaussians: &Gaussians,
    views: std::ops::Range<usize>,
    size: u32,
    seed: u64,
) -> Result<Vec<HeldOutCamera>> {
    let sampler = ViewSampler::new(gaussians, seed)?;
    let (up, centre) = (sampler.extent().up, sampler.extent().centre);
    let place = |index: usize| {
        let camera = sampler.camera(Split::HeldOut, index as u64, size);
        let eye: [f32; 3] = std::array::from_fn(|k| {
            -(0..3)
                .map(|r| camera.rotation[r][k] * camera.translation[r])
                .sum::<f32>()
        });
        let from: [f32; 3] = std::array::from_fn(|k| eye[k] - centre[k]);
        let length = from.iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        let height: f32 = from.iter().zip(up).map(|(f, u)| f * u).sum::<f32>() / length;
        HeldOutCamera {
            camera,
            elevation: height.clamp(-1.0, 1.0).asin().to_degrees(),
        }
    };
    Ok(views.map(place).collect())
}

/// Pictures of a scene from some cameras, over white.
pub(super) struct Views {
    pub cameras: Vec<HeldOutCamera>,
    pub images: Vec<RgbImage>,
    /// Whether somebody else made pictures of them, so that their tones may have been changed.
    pub processed: bool,
}

impl Views {
    pub fn render(engine: &Engine, gaussians: &Gaussians, cameras: &[HeldOutCamera]) -> Result<Self> {
        let geometry = Geometry::new(gaussians);
        let images = cameras
            .iter()
            .map(|placed| to_image(&engine.picture(&geometry, &placed.camera, [1.0; 3])?))
            .collect::<Result<_>>()?;
        Ok(Self {
            cameras: cameras.to_vec(),
            images,
            processed: false,
        })
    }

    pub fn pictures(&self) -> Result<Vec<Picture>> {
        Ok(self.images.iter().map(to_picture).collect())
    }

    /// The first pictures only: large ones of all views need not be there as floats.
    pub fn first(&self, count: usize) -> Vec<Picture> {
        self.images.iter().take(count).map(to_picture).collect()
    }

    /// What is read of all views; of pictures that somebody else made, under what may have been done to them.
    pub fn read<'a>(&self, engine: &'a Engine, message: &Message) -> Result<ViewReadings<'a>> {
        // One at a time: large pictures of all views need not be there as floats.
        let pictures = self.images.iter().map(to_picture);
        if self.processed && engine.extractor.reads_exact_colours() {
            let read = pictures.map(|picture| Ok(PictureLogits::read(engine, &picture, None, &[])?));
            return Ok(ViewReadings::Guessed(engine, read.collect::<Result<_>>()?, *message));
        }
        let mut logits = Vec::with_capacity(self.images.len());
        for picture in pictures {
            logits.extend(read_rendered(engine, &[picture])?);
        }
        Ok(ViewReadings::Decided(PooledLogits::new(logits)?))
    }

    /// The same views after an attack on each.
    pub fn attacked(&self, attack: &Attack, seed: u64) -> Result<Self> {
        let images = self.images.iter().enumerate();
        let images = images
            .map(|(index, image)| attack.apply(image, seed, index as u64).map_err(Error::Evaluation))
            .collect::<Result<_>>()?;
        Ok(Self {
            cameras: self.cameras.clone(),
            images,
            processed: attack.to_string() != names::NONE,
        })
    }

    /// The same views compressed by a learned codec and decompressed, in 8 bits again.
    pub fn compressed(&self, engine: &Engine, vae: &Vae) -> Result<Self> {
        let one = |image: &RgbImage| {
            engine.stop.check()?;
            let pictures = batch(&[&to_picture(image)], &engine.compute.device)?;
            let left = unbatch(vae.reconstruct(pictures))?;
            left.first().map_or_else(|| Ok(image.clone()), to_image)
        };
        Ok(Self {
            cameras: self.cameras.clone(),
            images: self.images.iter().map(one).collect::<Result<_>>()?,
            processed: true,
        })
    }

    /// What is read of these views, which were `before` until something was done to them.
    pub fn record(
        &self,
        engine: &Engine,
        message: &Message,
        mark: &Id,
        attack: &str,
        before: &Views,
    ) -> Result<ReadingRecord> {
        let code = &engine.message_code;
        let reading = self.read(engine, message)?;
        let right = reading
            .each()?
            .views
            .iter()
            .map(|logits| Ok((message.length().bits() - code.wrong_bits(logits, message)?) as u16))
            .collect::<Result<Vec<u16>>>()?;
        let mut from = BTreeMap::new();
        for views in MESSAGE_VIEWS.into_iter().filter(|n| *n as usize <= right.len()) {
            from.insert(
                views,
                code.wrong_bits(&reading.of_first(views as usize)?.summed, message)? == 0,
            );
        }
        Ok(ReadingRecord {
            mark: mark.clone(),
            attack: attack.into(),
            size: self.cameras.first().map_or(0, |placed| placed.camera.width),
            views: right.len() as u32,
            first_view: 0,
            bits: message.len() as u32,
            bits_right: right,
            message_right_from: from,
            psnr_db: self.psnr(before)?,
            elevation_deg: Some(self.cameras.iter().map(|placed| placed.elevation).collect()),
        })
    }

    /// Mean PSNR against other pictures of the same sizes, if they are, and differ.
    fn psnr(&self, before: &Views) -> Result<Option<f64>> {
        let pairs = || self.images.iter().zip(&before.images);
        if pairs().any(|(a, b)| a.dimensions() != b.dimensions()) {
            return Ok(None);
        }
        let each = pairs()
            .map(|(a, b)| psnr(&to_picture(a), &to_picture(b)))
            .collect::<guardsplat_engine::Result<Vec<_>>>()?;
        Ok(mean_psnr(&each)?.psnr_db)
    }
}

fn to_image(picture: &Picture) -> Result<RgbImage> {
    let bytes = picture.pixels.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
    RgbImage::from_raw(picture.width, picture.height, bytes.collect()).ok_or_else(|| {
        Error::bad_option(
            "picture",
            format!(
                "{} numbers are not {} x {} pixels",
                picture.pixels.len(),
                picture.width,
                picture.height
            ),
        )
    })
}

fn to_picture(image: &RgbImage) -> Picture {
    Picture {
        width: image.width(),
        height: image.height(),
        pixels: image.as_raw().iter().map(|v| f32::from(*v) / 255.0).collect(),
    }
}
