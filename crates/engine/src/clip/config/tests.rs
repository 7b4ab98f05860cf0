//! Tests of the configuration readers.
use super::*;

fn reason(json: &str) -> String {
    match ClipConfig::parse("test", json) {
        Err(Error::BadModel { reason, .. }) => reason,
        other => panic!("expected an error, got {other:?}"),
    }
}

const SMALL: &str = r#"{"embed_dim": 64, "vision_cfg": {"image_size": 64, "layers": [1, 1, 1, 1], "width": 16,
    "head_width": 32}, "text_cfg": {"context_length": 77, "vocab_size": 100, "width": 64, "heads": 2, "layers": 2}}"#;

#[test]
fn every_published_size_is_valid_and_survives_writing_and_reading() {
    for name in PUBLISHED {
        let config = published(name).unwrap();
        config.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(
            ClipConfig::parse(name, &config.to_open_clip().unwrap()).unwrap(),
            config,
            "{name}"
        );
    }
    assert_eq!(published("ViT-X"), None);
}

#[test]
fn hugging_face_defaults_are_those_of_transformers() {
    let parsed = ClipConfig::parse("b32", r#"{"vision_config": {}, "text_config": {"eos_token_id": 2}}"#).unwrap();
    assert_eq!(parsed, published("ViT-B/32").unwrap());
    let newer = ClipConfig::parse("b32", r#"{"vision_config": {}, "text_config": {}}"#).unwrap();
    assert_eq!(newer.text.end, EndToken::Id(49407));
}

#[test]
fn the_older_sections_override() {
    let json = r#"{"projection_dim": 768, "text_config": {"hidden_size": 512}, "vision_config": null,
        "text_config_dict": {"hidden_size": 768, "intermediate_size": 3072, "num_attention_heads": 12},
        "vision_config_dict": {"hidden_act": "gelu"}}"#;
    let config = ClipConfig::parse("l14", json).unwrap();
    assert_eq!(
        (config.embed_dim, config.text.width, config.text.blocks.heads),
        (768, 768, 12)
    );
    let VisionTower::Transformer { blocks, .. } = config.vision.tower else {
        panic!("not a transformer")
    };
    assert_eq!(blocks.activation, Activation::Gelu);
}

#[test]
fn open_clip_heads_follow_the_head_width() {
    let config = ClipConfig::parse("small", SMALL).unwrap();
    assert_eq!(
        config.vision.tower,
        VisionTower::ResNet {
            layers: [1; 4],
            heads: 16
        }
    );
    assert_eq!(config.text.blocks.activation, Activation::Gelu);
}

#[test]
fn what_does_not_fit_is_named() {
    for (from, to, needle) in [
        ("\"image_size\": 64", "\"image_size\": 65", "vision image_size is 65"),
        ("\"image_size\": 64", "\"image_size\": 100000", "must be 1 to 4096"),
        ("\"head_width\": 32", "\"head_width\": 0", "head_width"),
        ("\"head_width\": 32", "\"head_width\": 1000", "vision heads is 0"),
        (
            "\"heads\": 2",
            "\"heads\": 3",
            "text width is 64, must be a multiple of heads, 3",
        ),
        ("\"vocab_size\": 100", "\"vocab_size\": 99999999999", "text vocab_size"),
        ("\"heads\": 2", "\"heads\": -2", "invalid value"),
        (
            "\"heads\": 2",
            "\"heads\": 2, \"hf_model_name\": \"x\"",
            "unknown field `hf_model_name`",
        ),
        ("\"layers\": [1, 1, 1, 1]", "\"layers\": 12", "patch_size is missing"),
        (
            "\"layers\": [1, 1, 1, 1]",
            "\"layers\": [1, 1, 1, 65]",
            "vision layers is 65, must be 1 to 64",
        ),
    ] {
        assert!(SMALL.contains(from), "{from}");
        let found = reason(&SMALL.replace(from, to));
        assert!(found.contains(needle), "{to}: {found}");
    }
    assert!(reason("{}").contains("neither"));
    assert!(reason("[").contains("EOF"));
    assert!(reason(r#"{"vision_config": {"hidden_act": "relu"}}"#).contains("hidden_act"));
    assert!(reason(r#"{"text_config": {"vocab_size": 100}}"#).contains("eos_token_id 49407"));
}

#[test]
fn mean_and_deviation_come_from_the_files_beside() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("config.json"), SMALL).unwrap();
    assert_eq!(
        ClipConfig::read(dir.path()).unwrap().normalization,
        Normalization::default()
    );
    let json = r#"{"image_mean": [0.5, 0.5, 0.5], "image_std": [0.25, 0.25, 0.25]}"#;
    std::fs::write(dir.path().join("preprocessor_config.json"), json).unwrap();
    assert_eq!(ClipConfig::read(dir.path()).unwrap().normalization.std, [0.25; 3]);
    let json = json.replace("0.25, 0.25", "0.0, 0.25");
    std::fs::write(dir.path().join("preprocessor_config.json"), json).unwrap();
    assert!(ClipConfig::read(dir.path()).is_err());
}
