//! Arithmetic at the ends of its range: losses, metrics, the optimiser, half precision.
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Device, Tensor, TensorData};
use guardsplat_distortion::{Chroma, Draw, Jpeg, Layer, Ranges, RobustTo};
use guardsplat_engine::clip::{Clip, ClipConfig, ClipModel, Parts, Precision, normalize};
use guardsplat_engine::embed::{Adam, AdamOptions, Optimizer, Penalty, Preset};
use guardsplat_engine::message::{DecoderWeights, Projection, Reader, bce_from_logits};
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::{Psnr, Ssim, measure, psnr};
use guardsplat_engine::splat::{Rasterizer, WeightCache, prepare, sh};
use guardsplat_engine::stop::Stop;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::machine::Machine;
use super::marking::TINY;
use super::scenes::{BACKGROUND, camera, strange};

fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as::<f32>().unwrap()
}

fn row(values: &[f32], device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values.to_vec(), [1, values.len()]), device)
}

/// The stand-in for JPEG at both ends of its quality.
pub fn jpeg(machine: &Machine) {
    let device = machine.compute.device.clone().autodiff();
    let layer = Layer {
        robust_to: RobustTo::none(),
        ranges: Ranges::default(),
    };
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let noise: Vec<f32> = (0..3 * 24 * 24).map(|_| random.random()).collect();
    let flat = [0.0, 0.5, 1.0].map(|level| vec![level; 3 * 24 * 24]);
    for (quality, chroma) in [
        (1, Chroma::Half),
        (100, Chroma::Half),
        (1, Chroma::Full),
        (100, Chroma::Full),
    ] {
        for values in flat.iter().chain([&noise]) {
            let pictures =
                Tensor::<4>::from_data(TensorData::new(values.clone(), [1, 3, 24, 24]), &device).require_grad();
            let draw = Draw::Jpeg(Jpeg {
                quality,
                chroma,
                noise: None,
            });
            let out = layer.apply_with(&[draw], pictures.clone(), [1.0; 3]).unwrap();
            let gradient = host(pictures.grad(&out.clone().square().sum().backward()).unwrap());
            let out = host(out.inner());
            assert!(out.iter().all(|v| (0.0..=1.0).contains(v)), "quality {quality}");
            assert!(gradient.iter().all(|g| g.is_finite()), "quality {quality}");
            let mean = |of: &mut dyn Iterator<Item = f32>| of.sum::<f32>() / values.len() as f32;
            let change = mean(&mut out.iter().zip(values).map(|(a, b)| (a - b).abs()));
            if quality == 100 && chroma == Chroma::Full {
                assert!(change < 0.01, "quality {quality}: {change}");
            }
        }
    }
}

/// `max(x, 0) - x y + ln(1 + e^-|x|)` and its slope `sigmoid(x) - y`, in double precision.
pub fn cross_entropy(machine: &Machine) {
    let device = machine.compute.device.clone().autodiff();
    for x in [-1e4f32, -88.0, -20.0, -1.0, 0.0, 1.0, 20.0, 88.0, 1e4] {
        for y in [0.0f32, 1.0] {
            let logits = row(&[x], &device).require_grad();
            let loss = bce_from_logits(logits.clone(), row(&[y], &device));
            let slope = f64::from(host(logits.grad(&loss.backward()).unwrap())[0]);
            let loss = f64::from(host(loss.inner())[0]);
            let (z, y) = (f64::from(x), f64::from(y));
            let want = z.max(0.0) - z * y + (-z.abs()).exp().ln_1p();
            let want_slope = 1.0 / (1.0 + (-z).exp()) - y;
            assert!(
                (loss - want).abs() <= 1e-6 * (1.0 + want),
                "{x} {y}: {loss}, not {want}"
            );
            assert!((slope - want_slope).abs() <= 1e-6, "{x} {y}: {slope}, not {want_slope}");
        }
    }
}

/// A tower may answer with zeros, which have no direction: they stay zeros, the decoder says what its biases say, and
/// the gradient is a number.
pub fn zero_feature(machine: &Machine) {
    let device = machine.compute.device.clone().autodiff();
    let weights = DecoderWeights::seeded(16, 8, 3);
    let reader = Reader::new(&Projection::identity(16), &weights, &device);
    let features = row(&[0.0; 16], &device).require_grad();
    let unit = normalize(features.clone());
    assert_eq!(host(unit.clone().inner()), [0.0; 16]);
    let logits = reader.image_logits(unit);
    let read = host(logits.clone().inner());
    assert!(read.iter().all(|v| v.is_finite()) && read.iter().any(|v| *v != 0.0));
    let loss = bce_from_logits(logits, row(&[1.0; 8], &device));
    let gradient = host(features.grad(&loss.backward()).unwrap());
    assert!(gradient.iter().all(|v| v.is_finite()), "{gradient:?}");
}

/// Also where the variances are 0 and what they are divided by is the constant alone; its gradient is a number.
pub fn constant_similarity(machine: &Machine) {
    let device = machine.compute.device.clone().autodiff();
    let metric = Ssim::new(24, 20, &device);
    for value in [0.0, 0.5, 1.0] {
        let picture = || Tensor::<4>::full([1, 3, 24, 20], value, &device);
        let marked = picture().require_grad();
        let similarity = metric.mean(picture(), marked.clone());
        let gradient = host(marked.grad(&similarity.backward()).unwrap());
        let similarity = host(similarity.inner())[0];
        assert!((similarity - 1.0).abs() < 1e-5, "{value}: {similarity}");
        assert!(gradient.iter().all(|v| v.is_finite()));
    }
}

fn grey(value: f32) -> Picture {
    Picture {
        width: 33,
        height: 31,
        pixels: vec![value; 33 * 31 * 3],
    }
}

/// Infinity is told as a word: JSON has no number for it. One value that differs in its last bit is not identical.
pub fn identical_pictures() {
    let nearly = Picture {
        pixels: [&[0.5f32.next_up()][..], &grey(0.5).pixels[1..]].concat(),
        ..grey(0.5)
    };
    for value in [0.0, 0.5, 1.0] {
        assert_eq!(psnr(&grey(value), &grey(value)).unwrap(), Psnr::Identical);
    }
    let Psnr::Decibel(db) = psnr(&grey(0.5), &nearly).unwrap() else {
        panic!("taken for identical")
    };
    assert!(db.is_finite() && db > 150.0);
    let pairs = [(grey(0.5), grey(0.5)), (grey(1.0), grey(1.0))];
    let found = measure(&pairs, None, &Device::flex(), &Stop::default()).unwrap();
    let json = serde_json::to_value(found).unwrap();
    assert!(json["psnr_db"].is_null() && json["identical"] == true);
}

/// Ten million Gaussians whose offsets nothing but the penalty pulls at.
const GAUSSIANS: usize = 10_000_000;

/// A step is as long as the rate says, however small the gradient is. Really with as many rows, of constant
/// coefficients, and for the smaller gradients of the others with a thousand rows of that scene.
pub fn adam_in_a_vast_scene() {
    let paper = Preset::Paper.settings();
    let penalty = Penalty {
        dc: paper.lambda.offset_dc,
        rest: paper.lambda.offset_rest,
    };
    for preset in Preset::ALL {
        if let Optimizer::Adam(adam) = preset.settings().optimizer {
            assert!(adam.epsilon <= 1e-12);
        }
    }
    assert!(AdamOptions::tuned().epsilon <= 1e-12);
    let Optimizer::Adam(options) = paper.optimizer else {
        panic!("{:?}", paper.optimizer);
    };
    let step = |options: AdamOptions, rows: usize, stride: usize| {
        let mut adam = Adam::new(options, rows, stride, GAUSSIANS);
        let mut offsets = vec![5e-3; rows * stride];
        let mut gradient = vec![0.0; rows * stride];
        adam.step(1.0, penalty, &mut offsets, &mut gradient);
        offsets
    };
    // 2 * 10 * 5e-3 / 3e7 = 3.3e-9: the first step is the rate, 5e-3, and ends at 0.
    let offsets = step(options, GAUSSIANS, 3);
    assert_eq!(offsets.len(), 30_000_000);
    assert!(offsets.iter().all(|o| o.abs() < 1e-6), "{}", offsets[0]);
    drop(offsets);
    // 2 * 10 * 5e-3 / 4.5e8 = 2.2e-10 for the others, whose rate is 2.5e-4.
    let offsets = step(options, 1000, 48);
    assert!((offsets[3] - 4.75e-3).abs() < 1e-7, "{}", offsets[3]);
    // The common epsilon leaves a fiftieth of that step.
    let frozen = AdamOptions {
        epsilon: 1e-8,
        ..options
    };
    let moved = 5e-3 - step(frozen, 1000, 48)[3];
    assert!(moved < 0.025 * 2.5e-4, "{moved}");
    // An epsilon that squares of such gradients could not keep away from 0 is refused.
    let tiny = paper
        .overridden(r#"{"adam": {"epsilon": 1e-30}}"#)
        .unwrap_err()
        .to_string();
    assert!(tiny.contains("adam.epsilon"), "{tiny}");
}

struct Fill(f32);

impl ModuleMapper for Fill {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(|tensor| tensor.zeros_like() + self.0)
    }
}

/// Half precision is where models are kept, and the renderer's weights if asked for. A model's weight that has no half
/// is refused with the tensor's name when it is written, and an infinity when it is read.
pub fn half_precision_overflow(machine: &Machine) {
    let device = &machine.compute.device;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    std::fs::write(folder.path().join("config.json"), TINY).unwrap();
    let config = ClipConfig::parse("tiny", TINY).unwrap();
    let save = |value: f32, precision| {
        let model = ClipModel::init(&config, Parts::Both, device, 5).map(&mut Fill(value));
        model.save(&path, precision).map_err(|e| e.to_string())
    };
    // The largest number that rounds to 65504, and the smallest that does not.
    save(65519.0, Precision::F16).unwrap();
    let largest = std::fs::read(&path).unwrap();
    Clip::load(folder.path(), device, Parts::Both).unwrap();
    let refused = save(65520.0, Precision::F16).unwrap_err();
    assert!(
        refused.contains("tensor ") && refused.contains("not finite as F16"),
        "{refused}"
    );
    assert_eq!(std::fs::read(&path).unwrap(), largest, "the file before stays");
    save(65520.0, Precision::F32).unwrap();

    let mut infinite = largest;
    let last = infinite.len() - 2;
    assert_eq!(infinite[last..], [0xff, 0x7b], "matrices are halves and come last");
    infinite[last..].copy_from_slice(&[0x00, 0x7c]);
    std::fs::write(&path, infinite).unwrap();
    let refused = Clip::load(folder.path(), device, Parts::Both).unwrap_err().to_string();
    assert!(refused.contains("has inf at"), "{refused}");
    renderer_weights(machine.rasterizer.as_ref());
}

/// The renderer's are below 1, whatever the colours, which stay in single precision.
fn renderer_weights(rasterizer: &dyn Rasterizer) {
    let g = strange(200, 2);
    let pictures = [WeightCache::Weights, WeightCache::HalfWeights].map(|cache| {
        let view = prepare(&g, &camera(48), cache).unwrap();
        let colours = sh::colours(&g.sh, None, &view);
        let gradient = rasterizer.backward(&view, &vec![1e6; view.picture_len()]).unwrap();
        assert!(gradient.iter().all(|v| v.is_finite()));
        rasterizer.render(&view, &colours, BACKGROUND).unwrap().pixels
    });
    let largest = pictures[0].iter().fold(0.0f32, |most, v| most.max(*v));
    assert!(largest > 65504.0, "{largest}");
    for (single, half) in pictures[0].iter().zip(&pictures[1]) {
        assert!((single - half).abs() <= largest / 2048.0, "{single} {half}");
    }
}
