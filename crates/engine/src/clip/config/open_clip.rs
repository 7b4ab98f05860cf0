//! Reads and writes OpenCLIP's model configuration. Unknown fields are errors: most of them change what the
//! model computes without changing the shape of its weights.
use super::{
    Activation, BlockConfig, ClipConfig, EndToken, Normalization, TextConfig, Tones, VisionConfig, VisionTower,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// OpenCLIP's layer normalisations use torch's default.
const NORM_EPSILON: f64 = 1e-5;
const MLP_RATIO: f64 = 4.0;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Model {
    embed_dim: usize,
    #[serde(default)]
    quick_gelu: bool,
    vision_cfg: Vision,
    text_cfg: Text,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Vision {
    #[serde(default = "default_image_size")]
    image_size: usize,
    layers: Layers,
    width: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    patch_size: Option<usize>,
    #[serde(default = "default_head_width")]
    head_width: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mlp_ratio: Option<f64>,
    /// Only used in training by OpenCLIP; has no weights.
    #[serde(default, skip_serializing)]
    #[allow(dead_code)]
    patch_dropout: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Layers {
    Transformer(usize),
    ResNet([usize; 4]),
    /// Not OpenCLIP's: the project's own tower.
    Statistics {
        scales: Vec<usize>,
        kernel: usize,
        #[serde(default = "nothing_around")]
        surround: usize,
        #[serde(default, skip_serializing_if = "Tones::is_default")]
        tones: Tones,
        #[serde(default, skip_serializing_if = "is_zero")]
        equalization: f32,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    #[serde(default = "default_context_length")]
    context_length: usize,
    #[serde(default = "default_vocab_size")]
    vocab_size: usize,
    width: usize,
    heads: usize,
    layers: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mlp_ratio: Option<f64>,
}

#[derive(Deserialize)]
struct Preprocess {
    mean: Option<[f32; 3]>,
    std: Option<[f32; 3]>,
}

/// The pixel alone.
fn nothing_around() -> usize {
    1
}
fn is_zero(value: &f32) -> bool {
    *value == 0.0
}
fn default_image_size() -> usize {
    224
}
fn default_head_width() -> usize {
    64
}
fn default_context_length() -> usize {
    77
}
fn default_vocab_size() -> usize {
    49408
}

/// The configuration that `value` holds, either bare or inside `model_cfg` beside `preprocess_cfg`;
/// not yet validated.
pub(super) fn parse(mut value: Value) -> Result<ClipConfig, String> {
    let mut normalization = Normalization::default();
    if let Some(preprocess) = value.get_mut("preprocess_cfg").map(Value::take) {
        let found: Preprocess = serde_json::from_value(preprocess).map_err(|e| format!("preprocess_cfg: {e}"))?;
        if let (Some(mean), Some(std)) = (found.mean, found.std) {
            normalization = Normalization { mean, std };
        }
    }
    if let Some(model) = value.get_mut("model_cfg").map(Value::take) {
        value = model;
    }
    let model: Model = serde_json::from_value(value).map_err(|e| e.to_string())?;
    let activation = if model.quick_gelu {
        Activation::QuickGelu
    } else {
        Activation::Gelu
    };
    let blocks = |layers, heads, width: usize, ratio: Option<f64>| BlockConfig {
        layers,
        heads,
        mlp_width: (width as f64 * ratio.unwrap_or(MLP_RATIO)) as usize,
        activation,
        norm_epsilon: NORM_EPSILON,
    };
    let vision = model.vision_cfg;
    let heads = |features: usize| match vision.head_width {
        0 => Err("vision_cfg.head_width is 0, must be at least 1".to_string()),
        width => Ok(features / width),
    };
    let tower = match vision.layers {
        Layers::Transformer(layers) => VisionTower::Transformer {
            patch_size: vision.patch_size.ok_or("vision_cfg.patch_size is missing")?,
            blocks: blocks(layers, heads(vision.width)?, vision.width, vision.mlp_ratio),
        },
        Layers::ResNet(layers) => VisionTower::ResNet {
            layers,
            heads: heads(vision.width.saturating_mul(32))?,
        },
        Layers::Statistics {
            scales,
            kernel,
            surround,
            tones,
            equalization,
        } => VisionTower::Statistics {
            scales,
            kernel,
            surround,
            tones,
            equalization,
        },
    };
    let text = model.text_cfg;
    Ok(ClipConfig {
        embed_dim: model.embed_dim,
        vision: VisionConfig {
            image_size: vision.image_size,
            width: vision.width,
            tower,
        },
        text: TextConfig {
            context_length: text.context_length,
            vocab_size: text.vocab_size,
            width: text.width,
            blocks: blocks(text.layers, text.heads, text.width, text.mlp_ratio),
            end: EndToken::Largest,
        },
        normalization,
    })
}

/// The configuration in OpenCLIP's form (`model_cfg` and `preprocess_cfg`), or what it cannot express.
pub(super) fn write(config: &ClipConfig) -> Result<String, String> {
    let (vision, text) = (&config.vision, &config.text);
    let ratio = |blocks: &BlockConfig, width: usize| Some(blocks.mlp_width as f64 / width as f64);
    let mut towers = vec![&text.blocks];
    let (layers, patch_size, head_width, mlp_ratio) = match &vision.tower {
        VisionTower::Transformer { patch_size, blocks } => {
            towers.push(blocks);
            let mlp_ratio = ratio(blocks, vision.width);
            (
                Layers::Transformer(blocks.layers),
                Some(*patch_size),
                vision.width / blocks.heads,
                mlp_ratio,
            )
        }
        VisionTower::ResNet { layers, heads } => (Layers::ResNet(*layers), None, vision.width * 32 / heads, None),
        VisionTower::Statistics {
            scales,
            kernel,
            surround,
            tones,
            equalization,
        } => {
            let layers = Layers::Statistics {
                scales: scales.clone(),
                kernel: *kernel,
                surround: *surround,
                tones: *tones,
                equalization: *equalization,
            };
            (layers, None, default_head_width(), None)
        }
    };
    let activation = text.blocks.activation;
    if towers
        .iter()
        .any(|b| b.activation != activation || b.norm_epsilon != NORM_EPSILON)
    {
        return Err(format!(
            "needs one activation for both towers and an epsilon of {NORM_EPSILON}"
        ));
    }
    if text.end != EndToken::Largest {
        return Err("takes the text feature at the largest token only".into());
    }
    let model = Model {
        embed_dim: config.embed_dim,
        quick_gelu: activation == Activation::QuickGelu,
        vision_cfg: Vision {
            image_size: vision.image_size,
            layers,
            width: vision.width,
            patch_size,
            head_width,
            mlp_ratio,
            patch_dropout: 0.0,
        },
        text_cfg: Text {
            context_length: text.context_length,
            vocab_size: text.vocab_size,
            width: text.width,
            heads: text.blocks.heads,
            layers: text.blocks.layers,
            mlp_ratio: ratio(&text.blocks, text.width),
        },
    };
    let Normalization { mean, std } = config.normalization;
    let file = serde_json::json!({ "model_cfg": model, "preprocess_cfg": { "mean": mean, "std": std } });
    serde_json::to_string_pretty(&file).map_err(|e| e.to_string())
}
