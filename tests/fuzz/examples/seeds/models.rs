//! Keys and weights, mostly without their tensors: the targets fill in zeros.
use super::put;
use burn::tensor::Device;
use guardsplat_engine::clip::{ClipConfig, ClipModel, Parts, Precision};
use guardsplat_engine::message::key::Secret;
use guardsplat_engine::message::{ClipIdentity, DecoderWeights, Decoding, Key, Projection};
use guardsplat_fuzz::TINY_CLIP;

pub fn put_all() {
    keys();
    clips();
    lpips();
    configs();
    put("manifest", "clip", MANIFEST);
    put(
        "manifest",
        "unknown-file",
        MANIFEST.replace("config.json", "../config.json"),
    );
    put("manifest", "list", "[[[[[[[[1]]]]]]]]");
    put("manifest", "size-negative", MANIFEST.replace("123", "-1"));
}

/// A safetensors file up to where its tensors begin.
fn head(file: &[u8]) -> &[u8] {
    let length = u64::from_le_bytes(*file.first_chunk().expect("a file has eight bytes"));
    &file[..8 + length as usize]
}

/// A safetensors file without its tensors, of single precision.
fn header(tensors: &[(String, Vec<usize>)]) -> Vec<u8> {
    let mut at = 0;
    let entries: Vec<String> = tensors
        .iter()
        .map(|(name, shape)| {
            let start = at;
            at += 4 * shape.iter().product::<usize>();
            format!("\"{name}\":{{\"dtype\":\"F32\",\"shape\":{shape:?},\"data_offsets\":[{start},{at}]}}")
        })
        .collect();
    let text = format!("{{{}}}", entries.join(","));
    [&(text.len() as u64).to_le_bytes(), text.as_bytes()].concat()
}

fn keys() {
    let zeros = |bits| {
        let mut decoder = DecoderWeights::seeded(1, bits, 1);
        for layer in &mut decoder.layers {
            layer.weight.fill(0.0);
            layer.bias.fill(0.0);
        }
        let mut projection = Projection::identity(1);
        projection.matrix_image.fill(0.0);
        projection.matrix_text.fill(0.0);
        let key = Key {
            secret: Secret::from_seed(1),
            coded_bits: None,
            bits_per_token: 1,
            seed: Some(1),
            clip: ClipIdentity {
                name: "tiny".into(),
                hash: "ab".repeat(32),
            },
            decoding: Decoding::Clip { projection, decoder },
            accuracy_unseen: Some(0.5),
            accuracy_unseen_noisy: None,
        };
        head(&key.to_bytes().expect("a key is written")).to_vec()
    };
    put("key", "bits-32", zeros(32));
    put("key", "bits-1", zeros(1));
    put("key", "cut", &zeros(32)[..300]);
    let text = String::from_utf8_lossy(&zeros(32)).into_owned();
    put("key", "bits-99", text.replace("bits\\\":32", "bits\\\":99"));
    put("key", "version-2", text.replace("version\\\":1", "version\\\":2"));
    put("key", "other-id", text.replace("\\\"id\\\":\\\"", "\\\"id\\\":\\\"0"));
    put("key", "header-long", [&u64::MAX.to_le_bytes()[..], b"{}"].concat());
    put("key", "empty", b"\x02\0\0\0\0\0\0\0{}");
}

fn clips() {
    let config = ClipConfig::parse("tiny", TINY_CLIP).expect("the configuration is one");
    let folder = tempfile::tempdir().expect("a folder can be made");
    for (name, precision) in [("openclip-f32", Precision::F32), ("openclip-f16", Precision::F16)] {
        let path = folder.path().join(name);
        let model = ClipModel::init(&config, Parts::Both, &Device::flex(), 1);
        model.save(&path, precision).expect("a model is written");
        let file = std::fs::read(&path).expect("a file is read");
        put("clip_weights", name, &file);
        put("clip_weights", &format!("{name}-zeros"), head(&file));
        put("clip_weights", &format!("{name}-cut"), &file[..file.len() - 5]);
    }
    let hugging_face = header(&hugging_face());
    put("clip_weights", "hugging-face", &hugging_face);
    let text = String::from_utf8_lossy(&hugging_face).into_owned();
    put(
        "clip_weights",
        "hugging-face-missing",
        text.replace("text_model.embeddings", "text_model.embedding_"),
    );
    put("clip_weights", "integers", text.replace("F32", "I32"));
    put(
        "clip_weights",
        "shape-overflow",
        header(&[("a".into(), vec![0]), ("b".into(), vec![1])]),
    );
    put(
        "clip_weights",
        "header-long",
        [&(1u64 << 40).to_le_bytes()[..], b"{}"].concat(),
    );
}

/// The tensors of [`TINY_CLIP`] as Hugging Face calls them.
fn hugging_face() -> Vec<(String, Vec<usize>)> {
    let mut all = vec![
        ("logit_scale".to_string(), vec![]),
        ("text_projection.weight".to_string(), vec![2, 2]),
        ("visual_projection.weight".to_string(), vec![2, 2]),
        ("text_model.embeddings.token_embedding.weight".to_string(), vec![3, 2]),
        (
            "text_model.embeddings.position_embedding.weight".to_string(),
            vec![2, 2],
        ),
        ("vision_model.embeddings.class_embedding".to_string(), vec![2]),
        (
            "vision_model.embeddings.patch_embedding.weight".to_string(),
            vec![2, 3, 1, 1],
        ),
        (
            "vision_model.embeddings.position_embedding.weight".to_string(),
            vec![5, 2],
        ),
    ];
    let mut norms = vec!["text_model.final_layer_norm".to_string()];
    norms.extend(["vision_model.pre_layrnorm", "vision_model.post_layernorm"].map(String::from));
    for model in ["text_model", "vision_model"] {
        let layer = format!("{model}.encoder.layers.0");
        norms.extend(["layer_norm1", "layer_norm2"].map(|name| format!("{layer}.{name}")));
        for name in [
            "self_attn.q_proj",
            "self_attn.k_proj",
            "self_attn.v_proj",
            "self_attn.out_proj",
            "mlp.fc1",
            "mlp.fc2",
        ] {
            all.push((format!("{layer}.{name}.weight"), vec![2, 2]));
            all.push((format!("{layer}.{name}.bias"), vec![2]));
        }
    }
    for norm in norms {
        all.push((format!("{norm}.weight"), vec![2]));
        all.push((format!("{norm}.bias"), vec![2]));
    }
    all
}

fn lpips() {
    let mut tensors = Vec::new();
    let convolutions = [(3, 64, 11), (64, 192, 5), (192, 384, 3), (384, 256, 3), (256, 256, 3)];
    for (i, (inputs, outputs, kernel)) in convolutions.into_iter().enumerate() {
        tensors.push((
            format!("features.conv{i}.weight"),
            vec![outputs, inputs, kernel, kernel],
        ));
        tensors.push((format!("features.conv{i}.bias"), vec![outputs]));
        tensors.push((format!("lin{i}.weight"), vec![1, outputs, 1, 1]));
    }
    put("lpips", "zeros", header(&tensors));
    put("lpips", "one-missing", header(&tensors[1..]));
    tensors[0].1[0] = 63;
    put("lpips", "other-shape", header(&tensors));
    put("lpips", "empty", b"\x02\0\0\0\0\0\0\0{}");
    put(
        "lpips",
        "header-long",
        [&(1u64 << 30).to_le_bytes()[..], b"{}"].concat(),
    );
}

fn configs() {
    let target = "clip_config";
    put(target, "open-clip", TINY_CLIP);
    put(
        target,
        "open-clip-whole",
        format!(r#"{{"model_cfg": {TINY_CLIP}, "preprocess_cfg": {{"mean": [0,0,0], "std": [1,1,1]}}}}"#),
    );
    put(target, "width-0", TINY_CLIP.replace("\"width\": 2", "\"width\": 0"));
    put(target, "heads-0", TINY_CLIP.replace("\"heads\": 1", "\"heads\": 0"));
    put(
        target,
        "head-width-0",
        TINY_CLIP.replace("\"head_width\": 1", "\"head_width\": 0"),
    );
    put(
        target,
        "wide",
        TINY_CLIP.replace("\"width\": 2", "\"width\": 18446744073709551615"),
    );
    put(
        target,
        "ratio",
        TINY_CLIP.replace("\"mlp_ratio\": 1", "\"mlp_ratio\": 1e300"),
    );
    put(target, "resnet", RESNET);
    put(
        target,
        "resnet-large",
        RESNET
            .replace("[1, 1, 1, 1]", "[128, 128, 128, 128]")
            .replace("64", "8192"),
    );
    put(target, "statistics", STATISTICS);
    put(target, "hugging-face", HUGGING_FACE);
    put(
        target,
        "hugging-face-empty",
        r#"{"vision_config": {}, "text_config": null}"#,
    );
    put(
        target,
        "layers-128",
        HUGGING_FACE.replace("\"num_hidden_layers\": 1", "\"num_hidden_layers\": 128"),
    );
    put(
        target,
        "preprocessor",
        r#"{"image_mean": [0.5, 0.5, 0.5], "image_std": [0.25, 0.25, 1e-9], "crop_size": 224}"#,
    );
}

const RESNET: &str = r#"{"embed_dim": 8, "vision_cfg": {"image_size": 64, "layers": [1, 1, 1, 1], "width": 64},
"text_cfg": {"context_length": 5, "vocab_size": 9, "width": 8, "heads": 1, "layers": 1}}"#;
const STATISTICS: &str = r#"{"embed_dim": 8, "vision_cfg": {"image_size": 32, "layers": {"scales": [1, 2, 4], "kernel": 1},
"width": 16}, "text_cfg": {"context_length": 5, "vocab_size": 9, "width": 8, "heads": 1, "layers": 1}}"#;
const HUGGING_FACE: &str = r#"{"projection_dim": 8, "vision_config": {"hidden_size": 8, "intermediate_size": 16,
"num_attention_heads": 2, "num_hidden_layers": 1, "image_size": 8, "patch_size": 4, "hidden_act": "gelu"},
"text_config_dict": {"hidden_size": 8, "num_attention_heads": 2, "num_hidden_layers": 1, "vocab_size": 9,
"eos_token_id": 2, "layer_norm_eps": 1e-6}}"#;
const MANIFEST: &str = r#"{"name": "vit", "source": "https://h/m.safetensors", "files": {
"config.json": {"sha256": "00", "bytes": 123}, "model.safetensors": {"sha256": "ab", "bytes": 7}}}"#;
