//! What a CLIP model looks like: sizes of both towers, read from the configuration file it was published with.
mod hugging_face;
mod open_clip;
mod published;

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;

pub use published::{PUBLISHED, published};

/// Largest configuration file that is read, in bytes.
const MAX_CONFIG_BYTES: u64 = 1 << 20;

/// Sizes of a CLIP model, whichever file format told them.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipConfig {
    /// Width of the features that both towers share.
    pub embed_dim: usize,
    /// The image tower.
    pub vision: VisionConfig,
    /// The text tower.
    pub text: TextConfig,
    /// What is subtracted from the pictures and divided by.
    pub normalization: Normalization,
}

/// Sizes of the image tower.
#[derive(Clone, Debug, PartialEq)]
pub struct VisionConfig {
    /// Side of the square pictures it takes, in pixels.
    pub image_size: usize,
    /// Transformer: width of a token. ResNet: channels after the stem (features are 32 times wider). Statistics:
    /// filters a scale.
    pub width: usize,
    /// Its kind, with what only that kind has.
    pub tower: VisionTower,
}

/// The two kinds of image tower that CLIP was published with, and the project's own.
#[derive(Clone, Debug, PartialEq)]
pub enum VisionTower {
    /// Vision transformer.
    Transformer {
        /// Side of a patch in pixels; divides the picture's side.
        patch_size: usize,
        /// Its blocks.
        blocks: BlockConfig,
    },
    /// ResNet with a three-convolution stem, anti-aliased strides and an attention pool.
    ResNet {
        /// Bottleneck blocks in each of the four stages.
        layers: [usize; 4],
        /// Heads of the attention pool; divides `32 * width`.
        heads: usize,
    },
    /// Averages of small filters at several scales, and a linear head.
    Statistics {
        /// Sides of the squares that are averaged into one pixel.
        scales: Vec<usize>,
        /// Side of a filter; 1.
        kernel: usize,
        /// Side of the square whose mean is subtracted from a pixel before the filters, odd; 1 subtracts nothing.
        surround: usize,
        /// How what was done to the tones of a picture is found.
        tones: Tones,
        /// What the density of a pixel's colour counts against it, 0 to 1: its weight is the density to the power of minus
        /// this. 0 weighs all pixels alike.
        equalization: f32,
    },
}

/// How what was done to the tones of a picture, and which part of it shows the scene, is found before it is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tones {
    /// Every guess is read, and a claim pays for each. So it is where a configuration says nothing: towers from before
    /// there was an estimate.
    #[default]
    Searched,
    /// They are estimated from the picture and the key alone, whatever is claimed, so that a claim pays for one guess.
    Estimated,
}

impl Tones {
    /// Whether this is what a configuration means that says nothing.
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// Sizes of the text tower.
#[derive(Clone, Debug, PartialEq)]
pub struct TextConfig {
    /// Longest sequence, in tokens.
    pub context_length: usize,
    /// Number of token ids.
    pub vocab_size: usize,
    /// Width of a token.
    pub width: usize,
    /// Its blocks.
    pub blocks: BlockConfig,
    /// Where a sequence's feature is taken.
    pub end: EndToken,
}

/// What the residual blocks of a transformer have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockConfig {
    /// Number of blocks.
    pub layers: usize,
    /// Attention heads; divides the width.
    pub heads: usize,
    /// Width of the hidden layer of the multilayer perceptron.
    pub mlp_width: usize,
    /// Its activation.
    pub activation: Activation,
    /// Epsilon of the layer normalisations.
    pub norm_epsilon: f64,
}

/// Activation between the two layers of a perceptron.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// `x * sigmoid(1.702 x)`, in the models that OpenAI published.
    QuickGelu,
    /// The exact Gaussian error linear unit.
    Gelu,
}

/// The position of a sequence whose feature stands for the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndToken {
    /// The first position of the largest id (OpenAI, OpenCLIP, and Hugging Face's configurations with end id 2).
    Largest,
    /// The first position of this id; position 0 when it is absent.
    Id(u32),
}

/// Mean and standard deviation per channel (RGB) of the pictures the model was trained on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalization {
    /// Subtracted.
    pub mean: [f32; 3],
    /// Divided by.
    pub std: [f32; 3],
}

impl Default for Normalization {
    /// OpenAI's values, which nearly every CLIP uses.
    fn default() -> Self {
        Self {
            mean: [0.48145466, 0.4578275, 0.40821073],
            std: [0.26862954, 0.261_302_6, 0.275_777_1],
        }
    }
}

impl ClipConfig {
    /// Reads `config.json` (Hugging Face or OpenCLIP form) or `open_clip_config.json` in `dir`, and
    /// `preprocessor_config.json` for mean and deviation when it is there.
    ///
    /// # Errors
    /// [`Error::BadModel`] when there is none, when it is too large, or when a size is missing or out of its limits.
    pub fn read(dir: &Path) -> Result<Self> {
        let path = ["config.json", "open_clip_config.json"]
            .map(|name| dir.join(name))
            .into_iter()
            .find(|path| path.is_file())
            .ok_or_else(|| bad(dir.display(), "has no config.json"))?;
        let mut config = Self::parse(&path.display().to_string(), &read_bounded(&path)?)?;
        let preprocessor = dir.join("preprocessor_config.json");
        if preprocessor.is_file() {
            let name = preprocessor.display().to_string();
            config.preprocessed(&name, &read_bounded(&preprocessor)?)?;
        }
        Ok(config)
    }

    /// Takes mean and deviation from the text of a `preprocessor_config.json`, when it tells both; `name` is for error
    /// messages.
    ///
    /// # Errors
    /// [`Error::BadModel`] as for [`ClipConfig::read`].
    pub fn preprocessed(&mut self, name: &str, json: &str) -> Result<()> {
        if let Some(found) = hugging_face::normalization(json).map_err(|e| bad(name, e))? {
            self.normalization = found;
            self.validate().map_err(|e| bad(name, e))?;
        }
        Ok(())
    }

    /// Reads a configuration in either form from its text; `name` is for error messages.
    ///
    /// # Errors
    /// [`Error::BadModel`] as for [`ClipConfig::read`].
    pub fn parse(name: &str, json: &str) -> Result<Self> {
        let value: serde_json::Value = serde_json::from_str(json).map_err(|e| bad(name, e))?;
        let has = |key| value.get(key).is_some();
        let config = if has("vision_cfg") || has("model_cfg") {
            open_clip::parse(value)
        } else if has("vision_config") || has("text_config") {
            hugging_face::parse(value)
        } else {
            Err("is neither a Hugging Face CLIP configuration (vision_config) nor an OpenCLIP one (vision_cfg)".into())
        };
        config.and_then(|c| c.validate().map(|()| c)).map_err(|e| bad(name, e))
    }

    /// The configuration in OpenCLIP's form, for a model that is saved.
    ///
    /// # Errors
    /// [`Error::BadModel`] when OpenCLIP's form cannot express it (activations or epsilons that differ).
    pub fn to_open_clip(&self) -> Result<String> {
        open_clip::write(self).map_err(|e| bad("OpenCLIP configuration", e))
    }

    /// Whether features are ranked: a mark moves the first dimensions most, against how much they vary by themselves.
    /// So it is with heads that this project fits.
    pub fn is_ranked(&self) -> bool {
        matches!(self.vision.tower, VisionTower::Statistics { .. })
    }

    /// Checks every size against its limit and against the sizes it must divide or be divided by.
    fn validate(&self) -> Result<(), String> {
        within("embed_dim", self.embed_dim, 8192)?;
        let vision = &self.vision;
        within("vision image_size", vision.image_size, 4096)?;
        within("vision width", vision.width, 8192)?;
        match &vision.tower {
            VisionTower::Transformer { patch_size, blocks } => {
                within("vision patch_size", *patch_size, vision.image_size)?;
                divides("vision image_size", vision.image_size, "patch_size", *patch_size)?;
                blocks.validate("vision", vision.width)?;
            }
            VisionTower::ResNet { layers, heads } => {
                // Four times what was published: running averages take memory as soon as the tower is laid out.
                layers.iter().try_for_each(|n| within("vision layers", *n, 64))?;
                within("vision width", vision.width, 512)?;
                divides("vision image_size", vision.image_size, "the total stride", 32)?;
                divides("vision width", vision.width, "the stem's narrowing", 2)?;
                within("vision heads", *heads, 4096)?;
                divides("vision feature width", vision.width * 32, "heads", *heads)?;
            }
            VisionTower::Statistics {
                scales,
                kernel,
                surround,
                tones: _,
                equalization,
            } => {
                if !(0.0..=1.0).contains(equalization) {
                    return Err(format!("vision equalization is {equalization}, must be 0 to 1"));
                }
                within("vision scales", scales.len(), 16)?;
                // Sines are taken of single pixels.
                within("vision kernel", *kernel, 1)?;
                within("vision surround", *surround, 15)?;
                if surround.is_multiple_of(2) {
                    return Err(format!("vision surround is {surround}, must be odd"));
                }
                for scale in scales {
                    within("vision scale", *scale, vision.image_size)?;
                }
            }
        }
        let text = &self.text;
        within("text context_length", text.context_length, 4096)?;
        within("text vocab_size", text.vocab_size, 1 << 20)?;
        within("text width", text.width, 8192)?;
        text.blocks.validate("text", text.width)?;
        if let EndToken::Id(id) = text.end
            && id as usize >= text.vocab_size
        {
            return Err(format!(
                "text eos_token_id {id} is not below vocab_size {}",
                text.vocab_size
            ));
        }
        let Normalization { mean, std } = self.normalization;
        if !mean.iter().chain(&std).all(|v| v.is_finite()) || std.iter().any(|v| *v < 1e-3) {
            return Err(format!(
                "mean {mean:?} and std {std:?} must be finite, and std at least 0.001"
            ));
        }
        Ok(())
    }
}

impl BlockConfig {
    fn validate(&self, tower: &str, width: usize) -> Result<(), String> {
        within(&format!("{tower} layers"), self.layers, 128)?;
        within(&format!("{tower} heads"), self.heads, 4096)?;
        within(&format!("{tower} perceptron width"), self.mlp_width, 1 << 16)?;
        divides(&format!("{tower} width"), width, "heads", self.heads)?;
        if !(self.norm_epsilon > 0.0 && self.norm_epsilon < 1.0) {
            return Err(format!(
                "{tower} layer_norm_eps is {}, must be between 0 and 1",
                self.norm_epsilon
            ));
        }
        Ok(())
    }
}

fn within(field: &str, value: usize, most: usize) -> Result<(), String> {
    match (1..=most).contains(&value) {
        true => Ok(()),
        false => Err(format!("{field} is {value}, must be 1 to {most}")),
    }
}

fn divides(field: &str, value: usize, by: &str, divisor: usize) -> Result<(), String> {
    match value.is_multiple_of(divisor) {
        true => Ok(()),
        false => Err(format!("{field} is {value}, must be a multiple of {by}, {divisor}")),
    }
}

fn read_bounded(path: &Path) -> Result<String> {
    let bytes = std::fs::metadata(path).map_err(Error::io(path))?.len();
    if bytes > MAX_CONFIG_BYTES {
        return Err(bad(
            path.display(),
            format!("is {bytes} bytes, at most {MAX_CONFIG_BYTES} are read"),
        ));
    }
    std::fs::read_to_string(path).map_err(Error::io(path))
}

fn bad(name: impl ToString, reason: impl ToString) -> Error {
    Error::BadModel {
        name: name.to_string(),
        reason: reason.to_string(),
    }
}

#[cfg(test)]
mod tests;
