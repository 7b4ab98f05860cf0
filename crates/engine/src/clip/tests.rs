//! Tests of loading damaged or foreign weights, of gradients, and of training mode.
use super::*;
use burn::optim::{GradientsParams, SgdConfig};
use burn::tensor::{Distribution, TensorData};
use std::path::Path;
use tempfile::TempDir;

const RESNET: &str = r#"{"embed_dim": 8, "quick_gelu": true,
    "vision_cfg": {"image_size": 32, "layers": [1, 1, 1, 1], "width": 4, "head_width": 16},
    "text_cfg": {"context_length": 6, "vocab_size": 20, "width": 8, "heads": 2, "layers": 1}}"#;
const TRANSFORMER: &str = r#"{"embed_dim": 8, "vision_cfg": {"image_size": 32, "layers": 1, "width": 16, "patch_size": 8,
    "head_width": 8}, "text_cfg": {"context_length": 6, "vocab_size": 20, "width": 8, "heads": 2, "layers": 1}}"#;

fn model(json: &str, device: &Device) -> ClipModel {
    ClipModel::init(&ClipConfig::parse("test", json).unwrap(), Parts::Both, device, 7)
}

fn saved(json: &str) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("config.json"), json).unwrap();
    model(json, &Device::flex())
        .save(&dir.path().join("model.safetensors"), Precision::F32)
        .unwrap();
    dir
}

fn load(dir: &Path) -> Result<Clip> {
    Clip::load(dir, &Device::flex(), Parts::Both)
}

fn reason(dir: &TempDir) -> String {
    load(dir.path()).unwrap_err().to_string()
}

/// Rewrites the header of the saved weights.
fn edit_header(dir: &TempDir, from: &str, to: &str) {
    let path = dir.path().join("model.safetensors");
    let bytes = std::fs::read(&path).unwrap();
    let (length, rest) = bytes.split_first_chunk::<8>().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header = std::str::from_utf8(header).unwrap();
    assert!(header.contains(from), "{header}");
    let header = header.replace(from, to);
    let mut edited = (header.len() as u64).to_le_bytes().to_vec();
    edited.extend_from_slice(header.as_bytes());
    edited.extend_from_slice(data);
    std::fs::write(path, edited).unwrap();
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

fn noise(shape: [usize; 4], device: &Device) -> Tensor<4> {
    let count = shape.iter().product::<usize>();
    let data = (0..count)
        .map(|i| ((i * 7919 % 1000) as f32 / 1000.0).powi(2))
        .collect::<Vec<_>>();
    Tensor::from_data(TensorData::new(data, shape), device)
}

#[test]
fn a_missing_tensor_is_named_with_its_shape() {
    let dir = saved(RESNET);
    edit_header(&dir, "visual.layer2.0.bn1.bias", "visual.layer2.0.bn1.beta");
    let found = reason(&dir);
    assert!(
        found.contains("tensor visual.layer2.0.bn1.bias is missing, expected [8]"),
        "{found}"
    );
    assert!(
        found.contains("tensor visual.layer2.0.bn1.beta [8] is not expected"),
        "{found}"
    );
}

#[test]
fn a_wrong_shape_is_told_with_both_shapes() {
    let dir = saved(TRANSFORMER);
    edit_header(&dir, r#"[20,8]"#, r#"[10,16]"#);
    let found = reason(&dir);
    assert!(
        found.contains("tensor token_embedding.weight has shape [10, 16], expected [20, 8]"),
        "{found}"
    );
}

#[test]
fn another_architecture_is_refused_in_one_line() {
    let dir = saved(RESNET);
    std::fs::write(dir.path().join("config.json"), TRANSFORMER).unwrap();
    let found = reason(&dir);
    assert!(found.contains("more tensors") && found.len() < 600, "{found}");
}

#[test]
fn integers_and_values_that_are_not_finite_are_refused() {
    let dir = saved(TRANSFORMER);
    edit_header(
        &dir,
        r#""logit_scale":{"dtype":"F32""#,
        r#""logit_scale":{"dtype":"I32""#,
    );
    assert!(reason(&dir).contains("tensor logit_scale is I32, must be F32, F16 or BF16"));

    let path = dir.path().join("model.safetensors");
    let (mut poisoned, scale) = (model(TRANSFORMER, &Device::flex()), [f32::NAN]);
    poisoned.logit_scale = poisoned.logit_scale.map(|t| Tensor::from_floats(scale, &t.device()));
    assert!(
        poisoned
            .save(&path, Precision::F32)
            .unwrap_err()
            .to_string()
            .contains("logit_scale is not finite")
    );
}

#[test]
fn damaged_files_are_errors_and_allocate_nothing() {
    let dir = saved(TRANSFORMER);
    let path = dir.path().join("model.safetensors");
    let whole = std::fs::read(&path).unwrap();
    let mut huge = whole.clone();
    huge[..8].copy_from_slice(&(1u64 << 62).to_le_bytes());
    let mut large = (20u64 << 20).to_le_bytes().to_vec();
    large.resize(21 << 20, b' ');
    let mut junk = whole.clone();
    junk[8..20].fill(0xFF);
    for (bytes, needle) in [
        (&whole[..whole.len() - 4], "is truncated"),
        (&whole[..4], "too short"),
        (&whole[..40], "header promises"),
        (&huge, "header promises 4611686018427387904 bytes"),
        (&large, "header promises 20971520 bytes, at most 1048576"),
        (&junk, "safetensors header"),
        (b"{\"a\": 1}", "too short"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let found = reason(&dir);
        assert!(
            found.contains(needle) || bytes.len() == 8 && found.contains("header"),
            "{needle}: {found}"
        );
    }
    std::fs::remove_file(&path).unwrap();
    assert!(reason(&dir).contains("has no model.safetensors"));
}

#[test]
fn half_precision_loses_little_and_both_reload() {
    let dir = saved(RESNET);
    let whole = load(dir.path()).unwrap();
    whole
        .model()
        .save(&dir.path().join("model.safetensors"), Precision::F16)
        .unwrap();
    let half = load(dir.path()).unwrap();
    assert_ne!(whole.hash, half.hash);
    let pictures = noise([2, 3, 40, 20], &Device::flex());
    let (a, b) = (whole.image_features(pictures.clone()), half.image_features(pictures));
    let cosine = values((a.clone() * b).sum_dim(1));
    assert!(cosine.iter().all(|c| (0.999..1.001).contains(c)), "{cosine:?}");
    assert!(values(a.square().sum_dim(1)).iter().all(|l| (l - 1.0).abs() < 1e-5));
}

#[test]
fn the_same_seed_gives_the_same_weights() {
    let pictures = noise([1, 3, 32, 32], &Device::flex());
    let [a, b] = [0, 1].map(|_| values(model(RESNET, &Device::flex()).visual.unwrap().forward(pictures.clone())));
    assert_eq!(a, b);
    let config = ClipConfig::parse("test", RESNET).unwrap();
    let other = ClipModel::init(&config, Parts::Image, &Device::flex(), 8);
    assert_ne!(a, values(other.visual.unwrap().forward(pictures)));
}

/// The gradient reaches the picture, agrees with central differences, and no weight is tracked.
#[test]
fn a_loaded_model_is_frozen_and_differentiable_in_its_input() {
    for json in [RESNET, TRANSFORMER] {
        let dir = saved(json);
        let device = Device::flex().autodiff();
        let clip = load(dir.path()).unwrap();
        let target = noise([1, 1, 1, 8], &Device::flex()).reshape([1, 8]);
        let score = |x: Tensor<4>| (clip.image_features(x) * target.clone()).sum();
        let plain = noise([1, 3, 48, 48], &Device::flex());
        let x = Tensor::from_data(plain.to_data(), &device).require_grad();
        let gradient = x.grad(&score(x.clone()).backward()).unwrap().into_data();
        let gradient: Tensor<4> = Tensor::from_data(gradient, &Device::flex());
        // Along a direction in which the score rises everywhere: rounding would drown single pixels, and what remains
        // of slopes that cancel.
        let direction = noise([1, 3, 48, 48], &Device::flex()).abs() * gradient.clone().sign();
        let step = 1e-3;
        let at = |s: f64| values(score(plain.clone() + direction.clone().mul_scalar(s)))[0] as f64;
        let numeric = (at(step) - at(-step)) / (2.0 * step);
        let analytic = values((gradient * direction).sum())[0] as f64;
        assert!(
            (numeric - analytic).abs() < 0.02 * analytic.abs().max(1e-3),
            "{numeric} {analytic}"
        );

        let trained = Clip::load(dir.path(), &device, Parts::Both).unwrap();
        let gradients = trained.image_features(x.clone()).sum().backward();
        assert_eq!(GradientsParams::from_grads(gradients, trained.model()).len(), 0);
    }
}

#[test]
fn training_uses_and_follows_the_statistics_of_the_batch() {
    let device = Device::flex().autodiff();
    let model = model(RESNET, &device);
    let pictures = Tensor::<4>::random([8, 3, 32, 32], Distribution::Normal(3.0, 2.0), &Device::flex());
    let tracked = Tensor::from_data(pictures.to_data(), &device);
    let tower = |m: &ClipModel, x: Tensor<4>| m.visual.as_ref().unwrap().forward(x);

    let in_training = values(tower(&model, tracked.clone()));
    let before = values(tower(&model.valid(), pictures.clone()));
    // The running averages move towards the batch (by a tenth a pass): in the end, inference computes what training does.
    for _ in 0..300 {
        tower(&model, tracked.clone());
    }
    let after = values(tower(&model.valid(), pictures.clone()));
    let gap = |a: &[f32]| {
        a.iter()
            .zip(&in_training)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max)
    };
    assert!(
        gap(&after) < 0.01 * gap(&before).max(1e-3),
        "{} {}",
        gap(&after),
        gap(&before)
    );
    // A frozen model leaves them alone, on the same device.
    let frozen = model.clone().freeze();
    let gap = |a: Vec<f32>, b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(gap(values(tower(&frozen, tracked.clone())), &after) < 1e-4);

    let loss = tower(&model, tracked).square().mean();
    let gradients = GradientsParams::from_grads(loss.backward(), &model);
    assert!(gradients.len() > 40, "{}", gradients.len());
    let stepped = SgdConfig::new().init().step(0.1, model.clone(), gradients);
    assert!(gap(values(tower(&stepped.valid(), pictures)), &after) > 1e-4);
}

#[test]
fn a_zero_feature_stays_zero_with_a_finite_gradient() {
    let device = Device::flex().autodiff();
    let x = Tensor::<2>::zeros([1, 4], &device).require_grad();
    let y = normalize(x.clone());
    assert_eq!(values(y.clone()), [0.0; 4]);
    let gradient = x.grad(&y.sum().backward()).unwrap();
    assert!(values(gradient).iter().all(|g| g.is_finite()));
}
