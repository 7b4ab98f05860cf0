//! CLIP features equal those of transformers and open_clip, within 1e-4, before and after normalisation.
//! The fixtures are made by tools/parity/make_fixtures.py, which says with which versions.
use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};
use guardsplat_engine::clip::config::published;
use guardsplat_engine::clip::{Clip, ClipConfig, ClipModel, Parts, Precision, TensorFile, TensorSource, normalize};
use guardsplat_engine::error::Result;
use guardsplat_engine::resize::resize;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const TOLERANCE: f64 = 1e-4;

#[derive(Deserialize)]
struct Expected {
    #[serde(default)]
    tokens: Vec<Vec<i32>>,
    #[serde(default)]
    image_features: Vec<Vec<f64>>,
    #[serde(default)]
    text_features: Vec<Vec<f64>>,
    #[serde(default)]
    tensors: BTreeMap<String, Vec<usize>>,
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/clip")
}

fn expected(file: &str) -> Expected {
    serde_json::from_str(&std::fs::read_to_string(fixtures().join(file)).unwrap()).unwrap()
}

/// The fixtures' formula: splitmix64 seeded with the FNV-1a hash of the name, as values in [-1, 1).
fn uniform(name: &str, count: usize) -> Vec<f32> {
    let seed = name.bytes().fold(0xCBF2_9CE4_8422_2325u64, |h, b| {
        (h ^ b as u64).wrapping_mul(0x0100_0000_01B3)
    });
    let value = |i: u64| {
        let mut z = seed.wrapping_add(i.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    (1..=count as u64).map(value).collect()
}

/// Weights by formula, in the names and shapes that the reference listed.
struct Formula(BTreeMap<String, Vec<usize>>);

impl TensorSource for Formula {
    fn name(&self) -> &str {
        "formula"
    }
    fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.0.clone().into_iter().collect()
    }
    fn read(&mut self, name: &str) -> Result<Vec<f32>> {
        let shape = &self.0[name];
        let count: usize = shape.iter().product();
        let (base, scale) = match shape.len() {
            _ if name.ends_with("running_var") => (1.0, 0.5),
            _ if name.ends_with("running_mean") => (0.0, 0.1),
            1 if name.ends_with("weight") => (1.0, 0.1),
            0 | 1 => (0.0, 0.05),
            2 if name.contains("embedding") => (0.0, 0.05),
            _ => (0.0, (4.0 * shape[0] as f64 / count as f64).sqrt()),
        };
        Ok(uniform(name, count)
            .into_iter()
            .map(|u| base as f32 + scale as f32 * u)
            .collect())
    }
}

fn pictures(size: usize) -> Tensor<4> {
    let blocks = uniform("blocks", 2 * 3 * 8 * 8);
    let mut values = uniform("noise", 2 * 3 * size * size);
    for (i, value) in values.iter_mut().enumerate() {
        let (plane, y, x) = (i / (size * size), i / size % size, i % size);
        *value = blocks[plane * 64 + y * 8 / size * 8 + x * 8 / size] + 0.25 * *value;
    }
    Tensor::from_data(TensorData::new(values, [2, 3, size, size]), &Device::flex())
}

fn rows(features: Tensor<2>) -> Vec<Vec<f64>> {
    let width = features.dims()[1];
    features
        .into_data()
        .iter::<f64>()
        .collect::<Vec<_>>()
        .chunks(width)
        .map(<[f64]>::to_vec)
        .collect()
}

fn length(row: &[f64]) -> f64 {
    row.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Relative distance of raw features, largest difference of normalised ones, and the relative distance of the
/// *difference* between the two inputs, which catches a tower that hardly looks at its input.
fn compare(what: &str, found: Tensor<2>, expected: &[Vec<f64>]) {
    let (raw, normalized) = (rows(found.clone()), rows(normalize(found)));
    assert_eq!(raw.len(), expected.len());
    let (mut relative, mut largest) = (0f64, 0f64);
    for ((raw, normalized), expected) in raw.iter().zip(&normalized).zip(expected) {
        assert_eq!(raw.len(), expected.len());
        relative = relative.max(length(&minus(raw, expected)) / length(expected));
        let unit: Vec<f64> = expected.iter().map(|v| v / length(expected)).collect();
        largest = minus(normalized, &unit).iter().fold(largest, |m, d| m.max(d.abs()));
    }
    let (d, e) = (minus(&raw[0], &raw[1]), minus(&expected[0], &expected[1]));
    let contrast = length(&minus(&d, &e)) / length(&e);
    println!("{what}: relative {relative:.1e}, normalised {largest:.1e}, between inputs {contrast:.1e}");
    assert!(
        relative < TOLERANCE && largest < TOLERANCE && contrast < TOLERANCE,
        "{what} differs"
    );
}

fn tokens(expected: &Expected) -> Tensor<2, Int> {
    let shape = [expected.tokens.len(), expected.tokens[0].len()];
    Tensor::from_data(TensorData::new(expected.tokens.concat(), shape), &Device::flex())
}

fn compare_both(what: &str, model: &ClipModel, size: usize, expected: &Expected) {
    let visual = model.visual.as_ref().unwrap();
    compare(
        &format!("{what} image"),
        visual.forward(pictures(size)),
        &expected.image_features,
    );
    let text = model.text.as_ref().unwrap();
    compare(
        &format!("{what} text"),
        text.forward(tokens(expected)),
        &expected.text_features,
    );
}

#[test]
fn small_models_of_every_kind() {
    for name in ["hf_legacy_end", "hf_end_id", "openclip_vit", "openclip_rn"] {
        let dir = fixtures().join(format!("small_{name}"));
        let clip = Clip::load(&dir, &Device::flex(), Parts::Both).unwrap();
        compare_both(
            name,
            clip.model(),
            64,
            &expected(&format!("small_{name}/expected.json")),
        );
    }
}

#[test]
fn towers_load_alone() {
    let dir = fixtures().join("small_hf_end_id");
    let expected = expected("small_hf_end_id/expected.json");
    let image = Clip::load(&dir, &Device::flex(), Parts::Image).unwrap();
    assert!(image.model().text.is_none());
    compare(
        "image alone",
        image.model().visual.as_ref().unwrap().forward(pictures(64)),
        &expected.image_features,
    );
    let text = Clip::load(&dir, &Device::flex(), Parts::Text).unwrap();
    assert!(text.model().visual.is_none());
    compare(
        "text alone",
        text.model().text.as_ref().unwrap().forward(tokens(&expected)),
        &expected.text_features,
    );
}

#[test]
fn sequences_may_be_cut_after_the_end_token() {
    let clip = Clip::load(&fixtures().join("small_hf_legacy_end"), &Device::flex(), Parts::Text).unwrap();
    let first = tokens(&expected("small_hf_legacy_end/expected.json")).narrow(0, 0, 1);
    let whole = rows(clip.text_features(first.clone()));
    let cut = rows(clip.text_features(first.clone().slice([0..1, 0..5])));
    let short = rows(clip.text_features(first.slice([0..1, 0..4])));
    assert!(length(&minus(&whole[0], &cut[0])) < 1e-6);
    assert!(length(&minus(&whole[0], &short[0])) > 1e-3);
}

#[test]
fn vit_b32_in_its_real_shape() {
    let mut expected = expected("full_vit_b32.json");
    let mut source = Formula(std::mem::take(&mut expected.tensors));
    let config = published("ViT-B/32").unwrap();
    let model = ClipModel::new(&config, Parts::Both, &Device::flex())
        .load(&mut source)
        .unwrap();
    assert_eq!(model.num_params(), 151_277_313);
    compare_both("ViT-B/32", &model, 224, &expected);
}

#[test]
fn rn50_in_its_real_shape() {
    let mut expected = expected("full_rn50.json");
    let mut source = Formula(std::mem::take(&mut expected.tensors));
    let config = published("RN50").unwrap();
    let model = ClipModel::new(&config, Parts::Image, &Device::flex())
        .load(&mut source)
        .unwrap();
    compare(
        "RN50 image",
        model.visual.as_ref().unwrap().forward(pictures(224)),
        &expected.image_features,
    );
}

#[test]
fn resize_is_that_of_torch() {
    #[derive(Deserialize)]
    struct Case {
        from: [usize; 2],
        to: [usize; 2],
        values: Vec<f32>,
    }
    let text = std::fs::read_to_string(fixtures().join("resize.json")).unwrap();
    for Case {
        from: [h, w],
        to: [height, width],
        values,
    } in serde_json::from_str::<Vec<Case>>(&text).unwrap()
    {
        let data = TensorData::new(uniform(&format!("resize {h} {w}"), h * w), [1, 1, h, w]);
        let found = resize(Tensor::from_data(data, &Device::flex()), height, width).into_data();
        let worst = found
            .iter::<f32>()
            .zip(values)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(worst < 2e-6, "{h}x{w} to {height}x{width}: {worst}");
    }
}

#[test]
fn saved_models_load_again() {
    let dir = fixtures().join("small_openclip_rn");
    let clip = Clip::load(&dir, &Device::flex(), Parts::Both).unwrap();
    let saved = tempfile::tempdir().unwrap();
    let path = saved.path().join("model.safetensors");
    // The fixture's matrices are f16 already, so nothing is lost.
    clip.model().save(&path, Precision::F16).unwrap();
    std::fs::write(saved.path().join("config.json"), clip.config.to_open_clip().unwrap()).unwrap();
    let [ours, theirs] = [&path, &dir.join("model.safetensors")].map(|path| {
        let mut tensors = TensorFile::open(path).unwrap().tensors();
        tensors.sort();
        tensors
    });
    assert_eq!(ours, theirs);
    assert_eq!(ClipConfig::read(saved.path()).unwrap(), clip.config);
    let again = Clip::load(saved.path(), &Device::flex(), Parts::Both).unwrap();
    compare_both("saved", again.model(), 64, &expected("small_openclip_rn/expected.json"));
}
