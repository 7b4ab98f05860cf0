//! What reads a message from pictures: the part of the engine that embedding differentiates through, and readings ask.
use burn::tensor::{Device, Tensor};

use crate::clip::config::{Tones, VisionTower};
use crate::clip::{Clip, WeightedColours};
use crate::error::{Error, Result};
use crate::message::{Decoding, Key, Reader};
use crate::resize::resize;

/// Turns pictures into a number for each bit of a word.
///
/// Whatever reads 2D pictures differentiably can take CLIP's place: embedding needs the gradient of its logits to the
/// pictures, and nothing else of it.
pub trait Extractor: Send + Sync {
    /// Bits of a word.
    fn bits(&self) -> usize;

    /// Side in pixels of the square pictures that it looks at, whatever it is given.
    fn side(&self) -> usize;

    /// Numbers that it holds, for what it takes of memory.
    fn parameters(&self) -> usize;

    /// Whether a change of tones by a few hundredths makes it read something else.
    fn reads_exact_colours(&self) -> bool {
        false
    }

    /// How changed tones, and the part of a picture that shows the scene, are found where exact colours are read.
    fn tones(&self) -> Tones {
        Tones::Searched
    }

    /// Side of the squares of a picture that it looks at one by one and averages over, wherever they are; `None` where it
    /// matters where things are.
    fn square(&self) -> Option<usize> {
        None
    }

    /// Logits of pictures that were put together from such squares. They may be smaller or larger than [`Extractor::side`],
    /// and are not resized.
    ///
    /// # Errors
    /// As [`Extractor::logits`].
    fn square_logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        self.logits(pictures)
    }

    /// Sides of the squares of a picture over which colours are averaged, where nothing is read but how often each of these
    /// means is there; none where more is.
    fn colour_scales(&self) -> &[usize] {
        &[]
    }

    /// Logits `[b, bits]` of pictures of which each has these colours, a histogram for each of [`Extractor::colour_scales`].
    ///
    /// # Errors
    /// Where there are no such scales.
    fn colour_logits(&self, pictures: &[Vec<WeightedColours>]) -> Result<Tensor<2>> {
        let _ = pictures;
        Err(reads_more_than_colours())
    }

    /// Logits `[b, bits]` of pictures `[b, 3, h, w]` in [0, 1], positive for 1 and negative for 0; differentiable in the
    /// pictures.
    ///
    /// # Errors
    /// Pictures that it cannot read.
    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>>;
}

fn reads_more_than_colours() -> Error {
    Error::BadOption {
        field: "clip",
        reason: "it reads more than how often colours are there".into(),
    }
}

/// The published method: CLIP's features of a picture, the key's projection, and its decoder.
pub struct ClipExtractor {
    clip: Clip,
    reader: Reader,
    bits: usize,
}

impl ClipExtractor {
    /// Puts a CLIP and a key on `device` together. That they belong to each other is for the caller to check
    /// ([`Key::require_clip`]), who knows their files.
    ///
    /// # Errors
    /// When features and decoder differ in width, or the key reads pictures without a CLIP.
    pub fn new(clip: Clip, key: &Key, device: &Device) -> Result<Self> {
        let bad = |reason| Error::BadModel {
            name: key.clip.name.clone(),
            reason,
        };
        let Decoding::Clip { projection, decoder } = &key.decoding else {
            return Err(bad("the key reads pictures without a CLIP".into()));
        };
        let (found, width) = (clip.dim(), projection.width);
        if found != width {
            return Err(bad(format!(
                "its features have {found} dimensions, the key reads {width}"
            )));
        }
        Ok(Self {
            clip,
            reader: Reader::new(projection, decoder, device),
            bits: key.word_bits(),
        })
    }
}

impl Extractor for ClipExtractor {
    fn bits(&self) -> usize {
        self.bits
    }

    fn side(&self) -> usize {
        self.clip.config.vision.image_size
    }

    fn parameters(&self) -> usize {
        self.clip.parameters() + self.reader.parameters()
    }

    fn reads_exact_colours(&self) -> bool {
        matches!(self.clip.config.vision.tower, VisionTower::Statistics { .. })
    }

    fn tones(&self) -> Tones {
        match self.clip.config.vision.tower {
            VisionTower::Statistics { tones, .. } => tones,
            _ => Tones::Searched,
        }
    }

    fn square(&self) -> Option<usize> {
        match &self.clip.config.vision.tower {
            VisionTower::Statistics { scales, surround, .. } => {
                let largest = scales.iter().copied().max().filter(|_| *surround == 1)?;
                scales
                    .iter()
                    .all(|scale| largest.is_multiple_of(*scale))
                    .then_some(largest)
            }
            _ => None,
        }
    }

    fn colour_scales(&self) -> &[usize] {
        match (&self.clip.config.vision.tower, self.square()) {
            (VisionTower::Statistics { scales, .. }, Some(_)) => scales,
            _ => &[],
        }
    }

    fn colour_logits(&self, pictures: &[Vec<WeightedColours>]) -> Result<Tensor<2>> {
        let features = self.clip.features_of_colours(pictures);
        let features = features.ok_or_else(reads_more_than_colours)?;
        Ok(self.reader.image_logits(features))
    }

    fn square_logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        Ok(self.reader.image_logits(self.clip.features_as_they_are(pictures)))
    }

    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        Ok(self.reader.image_logits(self.clip.image_features(pictures)))
    }
}

/// A convolutional decoder in the manner of HiDDeN, which the key holds whole.
pub struct HiddenExtractor {
    network: guardsplat_hidden::Network,
    parameters: usize,
}

/// Side of the pictures that it looks at: that of the presets' training views, so that these are read as they are.
const HIDDEN_SIDE: usize = 160;

impl HiddenExtractor {
    /// Puts a key's decoder on `device`.
    ///
    /// # Errors
    /// A key that reads CLIP's features, and weights that do not fit together.
    pub fn new(key: &Key, device: &Device) -> Result<Self> {
        let Decoding::Hidden(weights) = &key.decoding else {
            return Err(Error::BadModel {
                name: key.clip.name.clone(),
                reason: "the key has no convolutional decoder".into(),
            });
        };
        Ok(Self {
            network: guardsplat_hidden::Network::new(weights, device)?,
            parameters: weights.tensors().iter().map(|tensor| tensor.values.len()).sum(),
        })
    }
}

impl Extractor for HiddenExtractor {
    fn bits(&self) -> usize {
        self.network.bits()
    }

    fn side(&self) -> usize {
        HIDDEN_SIDE
    }

    fn parameters(&self) -> usize {
        self.parameters
    }

    /// Pictures of other sizes are resized as CLIP's are, since the decoder knows textures by their size in pixels.
    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        Ok(self.network.logits(resize(pictures, HIDDEN_SIDE, HIDDEN_SIDE))?)
    }
}
