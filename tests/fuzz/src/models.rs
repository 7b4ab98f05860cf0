//! Keys, weights of models, and what says how they are to be read.
//!
//! Tensors are mostly not there: files that are cut off after their header are tried as they are, and again with zeros
//! for what is missing. So a file of a few hundred bytes gets as far as one of megabytes.
use crate::memory::bounded;
use burn::tensor::Device;
use guardsplat_engine::clip::{ClipConfig, ClipModel, Parts, TensorFile, TensorSource as _};
use guardsplat_engine::message::Key;
use guardsplat_engine::models::Entry;
use guardsplat_engine::quality::Lpips;
use safetensors::tensor::Metadata;
use std::borrow::Cow;
use std::sync::LazyLock;

/// The CLIP whose weights [`clip_weights`] reads: the smallest of all.
pub const TINY_CLIP: &str = r#"{"embed_dim": 2,
    "vision_cfg": {"image_size": 2, "layers": 1, "width": 2, "patch_size": 1, "head_width": 1, "mlp_ratio": 1},
    "text_cfg": {"context_length": 2, "vocab_size": 3, "width": 2, "heads": 1, "layers": 1, "mlp_ratio": 1}}"#;
/// Most bytes of tensors that are made up: LPIPS has 9.9 MB.
const MOST: usize = 12 << 20;

/// Key files.
pub fn key(data: &[u8]) {
    for file in [Cow::Borrowed(data), filled(data)] {
        if let Ok(key) = bounded(file.len(), || Key::from_bytes("fuzz", &file)) {
            let bytes = key.to_bytes().expect("a key that was read is written");
            assert!(Key::from_bytes("again", &bytes).expect("what is written is read") == key);
        }
    }
}

/// Weights of a CLIP.
pub fn clip_weights(data: &[u8]) {
    static CONFIG: LazyLock<ClipConfig> =
        LazyLock::new(|| ClipConfig::parse("tiny", TINY_CLIP).expect("the configuration is one"));
    for file in [Cow::Borrowed(data), filled(data)] {
        let (size, bytes) = (file.len(), file.into_owned());
        let Ok(mut weights) = bounded(size, || TensorFile::from_bytes("fuzz", bytes)) else {
            continue;
        };
        for (name, _) in weights.tensors() {
            let _ = bounded(size, || weights.read(&name));
        }
        let device = Device::flex();
        let fits = bounded(size, || ClipModel::check(&CONFIG, &weights)).is_ok();
        let loaded = bounded(size, || {
            ClipModel::new(&CONFIG, Parts::Both, &device).load(&mut weights)
        });
        assert!(fits || loaded.is_err());
    }
}

/// Configurations of CLIPs, in either form, and of their preprocessors.
pub fn clip_config(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(config) = bounded(data.len(), || ClipConfig::parse("fuzz", text)) {
        // What `models add` does next, on weights that have no tensor.
        let empty = TensorFile::from_bytes("empty", *b"\x02\0\0\0\0\0\0\0{}").expect("it is a file");
        assert!(bounded(data.len(), || ClipModel::check(&config, &empty)).is_err());
        if let Ok(text) = config.to_open_clip() {
            ClipConfig::parse("again", &text).expect("what is written is read");
        }
    }
    let mut config = ClipConfig::parse("tiny", TINY_CLIP).expect("the configuration is one");
    let _ = bounded(data.len(), || config.preprocessed("fuzz", text));
}

/// Weights of LPIPS.
pub fn lpips(data: &[u8]) {
    for file in [Cow::Borrowed(data), filled(data)] {
        let _ = bounded(file.len(), || Lpips::from_bytes(&file, &Device::flex()));
    }
}

/// Manifests of models that were added.
pub fn manifest(data: &[u8]) {
    if let Ok(entry) = bounded(data.len(), || Entry::parse(data)) {
        let text = serde_json::to_vec(&entry).expect("a manifest is JSON");
        assert_eq!(Entry::parse(&text).expect("what is written is read"), entry);
    }
}

/// A safetensors file with zeros for the tensors that its header promises.
fn filled(data: &[u8]) -> Cow<'_, [u8]> {
    let whole = || {
        let header = usize::try_from(u64::from_le_bytes(*data.first_chunk()?)).ok()?;
        let end = header.checked_add(8)?;
        let metadata: Metadata = serde_json::from_slice(data.get(8..end)?).ok()?;
        end.checked_add(metadata.data_len()).filter(|whole| *whole <= MOST)
    };
    match whole() {
        Some(whole) if whole > data.len() => {
            let mut file = data.to_vec();
            file.resize(whole, 0);
            Cow::Owned(file)
        }
        _ => Cow::Borrowed(data),
    }
}
