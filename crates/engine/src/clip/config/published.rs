//! The sizes that OpenAI published CLIP in (Radford et al. 2021, tables 19 and 20).
use super::{Activation, BlockConfig, ClipConfig, EndToken, Normalization, TextConfig, VisionConfig, VisionTower};

/// Names that [`published`] knows.
pub const PUBLISHED: [&str; 9] = [
    "ViT-B/32",
    "ViT-B/16",
    "ViT-L/14",
    "ViT-L/14@336px",
    "RN50",
    "RN101",
    "RN50x4",
    "RN50x16",
    "RN50x64",
];

/// The configuration of one of OpenAI's models, or `None` when the name is not one of [`PUBLISHED`].
pub fn published(name: &str) -> Option<ClipConfig> {
    // (feature width, picture side, vision width, tower, text width); heads are 64 wide everywhere.
    let (embed_dim, image_size, width, tower, text_width) = match name {
        "ViT-B/32" => (512, 224, 768, transformer(768, 12, 32), 512),
        "ViT-B/16" => (512, 224, 768, transformer(768, 12, 16), 512),
        "ViT-L/14" => (768, 224, 1024, transformer(1024, 24, 14), 768),
        "ViT-L/14@336px" => (768, 336, 1024, transformer(1024, 24, 14), 768),
        "RN50" => (1024, 224, 64, resnet(64, [3, 4, 6, 3]), 512),
        "RN101" => (512, 224, 64, resnet(64, [3, 4, 23, 3]), 512),
        "RN50x4" => (640, 288, 80, resnet(80, [4, 6, 10, 6]), 640),
        "RN50x16" => (768, 384, 96, resnet(96, [6, 8, 18, 8]), 768),
        "RN50x64" => (1024, 448, 128, resnet(128, [3, 15, 36, 10]), 1024),
        _ => return None,
    };
    Some(ClipConfig {
        embed_dim,
        vision: VisionConfig {
            image_size,
            width,
            tower,
        },
        text: TextConfig {
            context_length: 77,
            vocab_size: 49408,
            width: text_width,
            blocks: blocks(text_width, 12),
            end: EndToken::Largest,
        },
        normalization: Normalization::default(),
    })
}

fn blocks(width: usize, layers: usize) -> BlockConfig {
    BlockConfig {
        layers,
        heads: width / 64,
        mlp_width: width * 4,
        activation: Activation::QuickGelu,
        norm_epsilon: 1e-5,
    }
}

fn transformer(width: usize, layers: usize, patch_size: usize) -> VisionTower {
    VisionTower::Transformer {
        patch_size,
        blocks: blocks(width, layers),
    }
}

fn resnet(width: usize, layers: [usize; 4]) -> VisionTower {
    VisionTower::ResNet {
        layers,
        heads: width * 32 / 64,
    }
}
