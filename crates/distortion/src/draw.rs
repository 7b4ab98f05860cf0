//! What is done to one picture, and how that is drawn.
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::combined::Combined;
use crate::crop::Crop;
use crate::error::{Result, within};
use crate::jpeg::Jpeg;
use crate::kind::DistortionKind;
use crate::mask::{MAX_RECTANGLES, Rectangle};
use crate::noise::Noise;
use crate::ranges::{Ranges, limits, widen};

/// What is done to one picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Draw {
    /// Nothing.
    Clean,
    /// A window is cut out and enlarged to the size of the whole.
    Crop(Crop),
    /// Resized by this factor and back.
    Scaling(f32),
    /// Turned counter-clockwise by this many degrees.
    Rotation(f32),
    /// Colours times this.
    Brightness(f32),
    /// Distances from the mean grey times this.
    Contrast(f32),
    /// Compressed.
    Jpeg(Jpeg),
    /// Normal noise is added.
    Noise(Noise),
    /// Blurred with a window of three pixels and this deviation.
    Blur(f32),
    /// These are painted black.
    Mask(Vec<Rectangle>),
    /// Stored in 8 bits a value.
    #[serde(rename = "8bit")]
    EightBit,
    /// Crop, brightness and JPEG.
    Combined(Combined),
}

impl Draw {
    /// Which distortion it is; `None` for a clean picture.
    pub fn kind(&self) -> Option<DistortionKind> {
        Some(match self {
            Self::Clean => return None,
            Self::Crop(_) => DistortionKind::Crop,
            Self::Scaling(_) => DistortionKind::Scaling,
            Self::Rotation(_) => DistortionKind::Rotation,
            Self::Brightness(_) => DistortionKind::Brightness,
            Self::Contrast(_) => DistortionKind::Contrast,
            Self::Jpeg(_) => DistortionKind::Jpeg,
            Self::Noise(_) => DistortionKind::Noise,
            Self::Blur(_) => DistortionKind::Blur,
            Self::Mask(_) => DistortionKind::Mask,
            Self::EightBit => DistortionKind::EightBit,
            Self::Combined(_) => DistortionKind::Combined,
        })
    }

    /// Fails with [`crate::Error::OutOfRange`] unless all its numbers are within their limits.
    pub fn check(&self) -> Result<()> {
        let number = |field: &str, value: f32, [low, high]: [f64; 2]| within(field, widen(value), low, high);
        let crop = |crop: &Crop| {
            number("crop.keep", crop.keep, limits::CROP)?;
            number("crop.at", crop.at[0], limits::SHARE)?;
            number("crop.at", crop.at[1], limits::SHARE)
        };
        let jpeg = |jpeg: &Jpeg| number("jpeg.quality", f32::from(jpeg.quality), limits::QUALITY);
        match self {
            Self::Clean | Self::EightBit => Ok(()),
            Self::Crop(one) => crop(one),
            Self::Scaling(factor) => number("scaling", *factor, limits::SCALING),
            Self::Rotation(degrees) => number("rotation", *degrees, limits::ROTATION),
            Self::Brightness(factor) => number("brightness", *factor, limits::FACTOR),
            Self::Contrast(factor) => number("contrast", *factor, limits::FACTOR),
            Self::Jpeg(one) => jpeg(one),
            Self::Noise(one) => number("noise.sigma", one.sigma, limits::NOISE),
            Self::Blur(sigma) => number("blur", *sigma, limits::BLUR),
            Self::Mask(rectangles) => {
                let count = rectangles.len() as f64;
                within("number of rectangles", count, 0.0, MAX_RECTANGLES as f64)?;
                rectangles.iter().try_for_each(|one| {
                    number("mask.at", one.at[0], limits::SHARE)?;
                    number("mask.at", one.at[1], limits::SHARE)?;
                    number("mask.height", one.height, limits::SHARE)?;
                    number("mask.width", one.width, limits::SHARE)
                })
            }
            Self::Combined(one) => {
                crop(&one.crop)?;
                number("brightness", one.brightness, limits::FACTOR)?;
                jpeg(&one.jpeg)
            }
        }
    }

    /// One of clean and `kinds`, each as likely as the others, within `ranges`. Takes two numbers from `rng`, whatever
    /// is drawn; each distortion has a stream of its own that begins at the second, so that no range and no choice
    /// changes what the others draw. Kinds that act on the scene leave the picture clean.
    pub(crate) fn random(kinds: &[DistortionKind], ranges: &Ranges, rng: &mut ChaCha8Rng) -> Self {
        let (choice, seed) = (rng.random::<f64>(), rng.random::<u64>());
        // 0 is the clean picture.
        let choice = (choice * (kinds.len() + 1) as f64) as usize;
        match choice.checked_sub(1).and_then(|i| kinds.get(i)) {
            Some(kind) => Self::of(*kind, ranges, seed),
            None => Self::Clean,
        }
    }

    /// A distortion of this kind, drawn by `seed`.
    fn of(kind: DistortionKind, ranges: &Ranges, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(kind as u64);
        let rng = &mut rng;
        match kind {
            DistortionKind::Crop => Self::Crop(crop(ranges, rng)),
            DistortionKind::Scaling => Self::Scaling(between(ranges.scaling, rng)),
            DistortionKind::Rotation => Self::Rotation(between(ranges.rotation, rng)),
            DistortionKind::Brightness => Self::Brightness(between(ranges.brightness, rng)),
            DistortionKind::Contrast => Self::Contrast(between(ranges.contrast, rng)),
            DistortionKind::Jpeg => Self::Jpeg(jpeg(ranges, rng)),
            DistortionKind::Noise => Self::Noise(Noise {
                sigma: between(ranges.noise, rng),
                seed: rng.random(),
            }),
            DistortionKind::Blur => Self::Blur(between(ranges.blur, rng)),
            DistortionKind::Mask => Self::Mask(rectangles(ranges, rng)),
            DistortionKind::EightBit => Self::EightBit,
            DistortionKind::Combined => Self::Combined(Combined {
                crop: crop(ranges, rng),
                brightness: between(ranges.brightness, rng),
                jpeg: jpeg(ranges, rng),
            }),
            DistortionKind::ShNoise
            | DistortionKind::ShTruncation
            | DistortionKind::Spz
            | DistortionKind::Sog
            | DistortionKind::Pruning => Self::Clean,
        }
    }
}

fn between([low, high]: [f32; 2], rng: &mut ChaCha8Rng) -> f32 {
    // Rounding may go past the end; `clamp` would panic at ranges that nobody checked.
    (low + (high - low) * rng.random::<f32>()).max(low).min(high)
}

fn crop(ranges: &Ranges, rng: &mut ChaCha8Rng) -> Crop {
    let keep = between(ranges.crop.keep, rng);
    let centred = rng.random::<f32>() < ranges.crop.centred;
    let at = [rng.random(), rng.random()];
    Crop {
        keep,
        at: if centred { [0.5; 2] } else { at },
    }
}

fn jpeg(ranges: &Ranges, rng: &mut ChaCha8Rng) -> Jpeg {
    let [low, high] = ranges.jpeg.quality.map(f64::from);
    let steps = (high - low + 1.0).max(1.0);
    let quality = (low + (rng.random::<f64>() * steps).floor()) as u8;
    let seed = rng.random();
    Jpeg {
        quality,
        chroma: ranges.jpeg.chroma,
        noise: ranges.jpeg.noise.then_some(seed),
    }
}

/// One to four rectangles of one area, up to twice as long as wide or as wide as long.
fn rectangles(ranges: &Ranges, rng: &mut ChaCha8Rng) -> Vec<Rectangle> {
    let area = between(ranges.mask, rng);
    let count = 1 + (rng.random::<f32>() * MAX_RECTANGLES as f32) as usize;
    let each = area / count as f32;
    let all: [Rectangle; MAX_RECTANGLES] = std::array::from_fn(|_| {
        let at = [rng.random(), rng.random()];
        let ratio = 2.0_f32.powf(2.0 * rng.random::<f32>() - 1.0);
        let height = (each * ratio).sqrt().min(1.0);
        let width = if height > 0.0 { (each / height).min(1.0) } else { 0.0 };
        Rectangle { at, height, width }
    });
    all.into_iter().take(count).collect()
}
