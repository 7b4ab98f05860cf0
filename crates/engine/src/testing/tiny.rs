//! A CLIP of a few thousand parameters besides its vocabulary, with random weights.
use std::path::Path;

use crate::clip::{ClipConfig, ClipModel, Parts, Precision};
use crate::device::{Compute, DeviceChoice, open};

/// Its configuration.
pub const TINY: &str = r#"{"embed_dim": 16, "vision_cfg": {"image_size": 32, "layers": [1, 1, 1, 1], "width": 8},
    "text_cfg": {"context_length": 77, "vocab_size": 49408, "width": 8, "heads": 1, "layers": 1}}"#;

pub fn cpu() -> Compute {
    open(DeviceChoice::Cpu).unwrap()
}

pub fn model(compute: &Compute) -> (ClipConfig, ClipModel) {
    let config = ClipConfig::parse("tiny", TINY).unwrap();
    let model = ClipModel::init(&config, Parts::Both, &compute.device, 5);
    (config, model)
}

/// Writes it to a new folder, for `$GUARDSPLAT_CLIP`.
pub fn write(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    std::fs::write(folder.join("config.json"), TINY).unwrap();
    let (_, model) = model(&cpu());
    model.save(&folder.join("model.safetensors"), Precision::F32).unwrap();
}
