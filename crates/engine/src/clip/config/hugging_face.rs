//! Reads Hugging Face's `config.json` of a `CLIPModel`. What the file leaves out has the value that
//! transformers' `CLIPTextConfig` and `CLIPVisionConfig` give it, because it writes differences only.
use super::{Activation, BlockConfig, ClipConfig, EndToken, Normalization, TextConfig, VisionConfig, VisionTower};
use serde::Deserialize;
use serde_json::Value;

#[derive(Deserialize)]
struct File {
    #[serde(default = "default_projection")]
    projection_dim: usize,
    #[serde(default)]
    vision_config: Value,
    #[serde(default)]
    vision_config_dict: Value,
    #[serde(default)]
    text_config: Value,
    #[serde(default)]
    text_config_dict: Value,
}

fn default_projection() -> usize {
    512
}

#[derive(Deserialize)]
#[serde(default)]
struct Tower {
    hidden_size: usize,
    intermediate_size: usize,
    num_hidden_layers: usize,
    num_attention_heads: usize,
    hidden_act: String,
    layer_norm_eps: f64,
    // Vision only.
    num_channels: usize,
    image_size: usize,
    patch_size: usize,
    // Text only.
    vocab_size: usize,
    max_position_embeddings: usize,
    eos_token_id: u32,
}

impl Default for Tower {
    /// The text tower's widths; the vision tower's are filled in by [`parse`].
    fn default() -> Self {
        Self {
            hidden_size: 512,
            intermediate_size: 2048,
            num_hidden_layers: 12,
            num_attention_heads: 8,
            hidden_act: "quick_gelu".into(),
            layer_norm_eps: 1e-5,
            num_channels: 3,
            image_size: 224,
            patch_size: 32,
            vocab_size: 49408,
            max_position_embeddings: 77,
            eos_token_id: 49407,
        }
    }
}

impl Tower {
    fn blocks(&self) -> Result<BlockConfig, String> {
        let activation = match self.hidden_act.as_str() {
            "quick_gelu" => Activation::QuickGelu,
            "gelu" => Activation::Gelu,
            other => {
                return Err(format!("hidden_act is {other:?}, must be \"quick_gelu\" or \"gelu\""));
            }
        };
        Ok(BlockConfig {
            layers: self.num_hidden_layers,
            heads: self.num_attention_heads,
            mlp_width: self.intermediate_size,
            activation,
            norm_epsilon: self.layer_norm_eps,
        })
    }
}

/// The configuration that `value` holds; not yet validated.
pub(super) fn parse(value: Value) -> Result<ClipConfig, String> {
    let file: File = serde_json::from_value(value).map_err(|e| e.to_string())?;
    let vision_defaults = serde_json::json!({
        "hidden_size": 768, "intermediate_size": 3072, "num_attention_heads": 12
    });
    let vision = tower(
        "vision_config",
        [vision_defaults, file.vision_config, file.vision_config_dict],
    )?;
    let text = tower("text_config", [Value::Null, file.text_config, file.text_config_dict])?;
    if vision.num_channels != 3 {
        return Err(format!(
            "vision_config.num_channels is {}, must be 3",
            vision.num_channels
        ));
    }
    Ok(ClipConfig {
        embed_dim: file.projection_dim,
        vision: VisionConfig {
            image_size: vision.image_size,
            width: vision.hidden_size,
            tower: VisionTower::Transformer {
                patch_size: vision.patch_size,
                blocks: vision.blocks()?,
            },
        },
        text: TextConfig {
            context_length: text.max_position_embeddings,
            vocab_size: text.vocab_size,
            width: text.hidden_size,
            blocks: text.blocks()?,
            // Configurations from before 2023 say 2, which never was the end token; there the largest id is meant.
            end: match text.eos_token_id {
                2 => EndToken::Largest,
                id => EndToken::Id(id),
            },
        },
        normalization: Normalization::default(),
    })
}

/// Merges defaults, the section, and the older `..._config_dict` section, which overrides.
fn tower(name: &str, sections: [Value; 3]) -> Result<Tower, String> {
    let mut merged = serde_json::Map::new();
    for section in sections {
        match section {
            Value::Null => {}
            Value::Object(fields) => merged.extend(fields.into_iter().filter(|(_, v)| !v.is_null())),
            other => return Err(format!("{name} is {other}, must be an object")),
        }
    }
    serde_json::from_value(Value::Object(merged)).map_err(|e| format!("{name}: {e}"))
}

/// Mean and deviation from `preprocessor_config.json`, when it tells both.
pub(super) fn normalization(json: &str) -> Result<Option<Normalization>, String> {
    #[derive(Deserialize)]
    struct Preprocessor {
        image_mean: Option<[f32; 3]>,
        image_std: Option<[f32; 3]>,
    }
    let file: Preprocessor = serde_json::from_str(json).map_err(|e| e.to_string())?;
    Ok(file
        .image_mean
        .zip(file.image_std)
        .map(|(mean, std)| Normalization { mean, std }))
}
