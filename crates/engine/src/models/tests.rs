//! Tests of the registry, on a tiny CLIP.
use super::*;
use crate::clip::{Clip, ClipConfig, ClipModel, Parts, Precision};
use burn::tensor::Device;
use tempfile::TempDir;

/// A folder with a tiny CLIP, and the hash of its weights.
fn tiny() -> (TempDir, String) {
    let dir = tempfile::tempdir().unwrap();
    let json = r#"{"embed_dim": 8, "vision_cfg": {"image_size": 32, "layers": [1, 1, 1, 1], "width": 2},
        "text_cfg": {"context_length": 5, "vocab_size": 9, "width": 8, "heads": 1, "layers": 1}}"#;
    let config = ClipConfig::parse("tiny", json).unwrap();
    std::fs::write(dir.path().join(CONFIG), json).unwrap();
    let model = ClipModel::init(&config, Parts::Both, &Device::flex(), 1);
    model.save(&dir.path().join(WEIGHTS), Precision::F32).unwrap();
    let sha256 = hash(&mut std::fs::File::open(dir.path().join(WEIGHTS)).unwrap()).unwrap();
    (dir, sha256)
}

fn reason<T: std::fmt::Debug>(result: Result<T>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn a_model_is_added_listed_verified_and_loaded() {
    let ((source, sha256), home) = (tiny(), tempfile::tempdir().unwrap());
    let models = Models::at(home.path());
    assert_eq!(models.list().unwrap(), []);
    let entry = models
        .add("tiny", source.path().to_str().unwrap(), Some(&sha256.to_uppercase()))
        .unwrap();
    assert_eq!(entry.files.keys().collect::<Vec<_>>(), [CONFIG, WEIGHTS]);
    assert_eq!(models.list().unwrap(), std::slice::from_ref(&entry));
    assert_eq!(models.verify("tiny").unwrap(), entry);
    let clip = Clip::load(&models.dir("tiny").unwrap(), &Device::flex(), Parts::Both).unwrap();
    assert_eq!(clip.hash, sha256);
    assert!(reason(models.add("tiny", source.path().to_str().unwrap(), Some(&sha256))).contains("is there already"));
}

#[test]
fn verify_names_the_file_that_changed() {
    let ((source, sha256), home) = (tiny(), tempfile::tempdir().unwrap());
    let models = Models::at(home.path());
    let weights = source.path().join(WEIGHTS);
    models.add("tiny", weights.to_str().unwrap(), Some(&sha256)).unwrap();
    std::fs::write(models.dir("tiny").unwrap().join(CONFIG), "{}").unwrap();
    assert!(reason(models.verify("tiny")).contains("config.json has hash"));
    assert!(reason(models.verify("other")).contains("models add"));
}

#[test]
fn what_fails_leaves_nothing_behind() {
    let ((source, sha256), home) = (tiny(), tempfile::tempdir().unwrap());
    let models = Models::at(home.path());
    let path = source.path().to_str().unwrap();
    let empty = tempfile::tempdir().unwrap();
    let lone = empty.path().join(WEIGHTS);
    for (source, sha256, needle) in [
        (path, "0".repeat(64), "expected 0000"),
        (path, "xyz".into(), "64 hexadecimal"),
        ("http://example.org/model.safetensors", sha256.clone(), "https"),
        ("/does/not/exist.safetensors", sha256.clone(), "does not exist"),
        (
            empty.path().to_str().unwrap(),
            sha256.clone(),
            "has no model.safetensors",
        ),
    ] {
        let found = reason(models.add("tiny", source, Some(&sha256)));
        assert!(found.contains(needle), "{source}: {found}");
    }
    std::fs::copy(source.path().join(WEIGHTS), &lone).unwrap();
    assert!(reason(models.add("tiny", path_of(&lone), Some(&sha256))).contains("config.json does not exist"));
    // A configuration that parses but does not fit the weights.
    let wrong = std::fs::read_to_string(source.path().join(CONFIG))
        .unwrap()
        .replace("\"embed_dim\": 8", "\"embed_dim\": 6");
    std::fs::write(empty.path().join(CONFIG), wrong).unwrap();
    assert!(reason(models.add("tiny", path_of(&lone), Some(&sha256))).contains("expected [6"));
    assert_eq!(models.list().unwrap(), []);
    assert_eq!(std::fs::read_dir(home.path().join("models")).unwrap().count(), 0);
}

fn path_of(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn names_cannot_leave_the_folder() {
    let models = Models::at("/nonexistent");
    for name in ["", "..", "../x", "a/b", ".hidden", "Upper", &"x".repeat(65)] {
        assert!(reason(models.dir(name)).contains("a name has"), "{name}");
    }
}

#[test]
fn lpips_needs_no_configuration() {
    let ((source, sha256), home) = (tiny(), tempfile::tempdir().unwrap());
    std::fs::remove_file(source.path().join(CONFIG)).unwrap();
    let models = Models::at(home.path());
    let entry = models
        .add(LPIPS, path_of(&source.path().join(WEIGHTS)), Some(&sha256))
        .unwrap();
    assert_eq!(entry.files.len(), 1);
}

#[test]
fn configurations_are_looked_for_beside_the_weights() {
    let beside = |url: &str| fetch::Source::parse("x", url).unwrap().beside(CONFIG).to_string();
    assert_eq!(
        beside("https://h/a/b/model.safetensors?download=true"),
        "https://h/a/b/config.json"
    );
    assert_eq!(
        beside("https://h/a/open_clip_model.safetensors"),
        "https://h/a/open_clip_config.json"
    );
    assert_eq!(beside("/m/open_clip_model.safetensors"), "/m/open_clip_config.json");
}
