//! Embedding and reading know extractors by the trait alone: one of three lines, and a convolutional decoder.
use burn::tensor::Tensor;
use guardsplat_engine::embed::{Optimizer, PreconditionedSgdOptions, Settings, optimise};
use guardsplat_engine::extract::{Engine, Extractor, HiddenExtractor, read_scene};
use guardsplat_engine::message::key::{HiddenKeyOptions, create_hidden_key};
use guardsplat_engine::message::{Decoding, Message};
use guardsplat_engine::scene::Scene;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::view::ViewSampler;
use guardsplat_engine::{Error, Result};

use super::{clip, cpu, settings, small_scene};

/// Reads a bit from each channel: whether its mean is above that of all three.
struct Tint;

impl Extractor for Tint {
    fn bits(&self) -> usize {
        3
    }

    fn side(&self) -> usize {
        32
    }

    fn parameters(&self) -> usize {
        0
    }

    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        let [b, c, h, w] = pictures.dims();
        let means: Tensor<2> = pictures.reshape([b, c, h * w]).mean_dim(2).reshape([b, c]);
        Ok((means.clone() - means.mean_dim(1)) * 200.0)
    }
}

/// Message only, over black, so that nothing else decides the colours.
fn message_only() -> Settings {
    let mut settings = settings();
    settings.steps = 40;
    settings.optimizer = Optimizer::PreconditionedSgd(PreconditionedSgdOptions {
        length: 0.02,
        ..PreconditionedSgdOptions::default()
    });
    settings.lambda.reconstruction = 0.0;
    settings.black_backgrounds = 1.0;
    settings
}

#[test]
fn any_differentiable_extractor_can_be_embedded_for() {
    let engine = Engine::with_extractor(cpu(), Box::new(Tint), None);
    let scene = Scene::from_gaussians(small_scene());
    for text in ["5", "2"] {
        let message = Message::parse(text, 3).unwrap();
        let found = optimise(&engine, &scene, &message, &message_only(), &[], &mut |_| {}).unwrap();
        let mut marked = scene.gaussians.clone();
        marked.sh = found.learned.colours(&marked.sh);
        let reading = read_scene(
            &engine,
            &marked,
            &ViewSampler::new(&marked, 3).unwrap(),
            4,
            32,
            [0.0; 3],
            |_, _| Ok(()),
        )
        .unwrap();
        assert_eq!(reading.reading().message(), message, "{reading:?}");
    }
}

#[test]
fn convolutional_decoders_come_with_the_key() {
    let options = HiddenKeyOptions {
        bits: 4,
        seed: Some(3),
        steps: Some(2),
        robust_to: "brightness".parse().unwrap(),
    };
    let stop = Stop::default();
    let mut told = Vec::new();
    let key = create_hidden_key(&options, &cpu(), &stop, |done, total| told.push((done, total))).unwrap();
    assert_eq!(told.last(), Some(&(2, 2)));
    assert_eq!(create_hidden_key(&options, &cpu(), &stop, |_, _| {}).unwrap(), key);
    let other = HiddenKeyOptions {
        seed: Some(4),
        ..options.clone()
    };
    let other = create_hidden_key(&other, &cpu(), &stop, |_, _| {}).unwrap();
    assert_ne!(other.id(), key.id());
    assert_eq!(other.clip, key.clip);
    assert!(matches!(key.decoding, Decoding::Hidden(_)) && key.accuracy_unseen.is_some());

    let compute = cpu();
    let extractor = HiddenExtractor::new(&key, &compute.device).unwrap();
    let engine = Engine::with_extractor(compute, Box::new(extractor), None);
    assert_eq!(engine.bits, 4);
    // Whatever the size of pictures is.
    for size in [20, 160, 200] {
        let reading = read_scene(
            &engine,
            &small_scene(),
            &ViewSampler::new(&small_scene(), 3).unwrap(),
            1,
            size,
            [1.0; 3],
            |_, _| Ok(()),
        )
        .unwrap();
        assert_eq!(reading.views[0].len(), 4);
    }

    stop.request();
    let stopped = create_hidden_key(&options, &cpu(), &stop, |_, _| {}).unwrap_err();
    assert!(matches!(stopped, Error::Stopped), "{stopped}");
    let many = HiddenKeyOptions { bits: 129, ..options };
    let refused = create_hidden_key(&many, &cpu(), &Stop::default(), |_, _| {}).unwrap_err();
    assert!(refused.to_string().contains("129 is outside 1 to 128"), "{refused}");
    let error = Engine::new(cpu(), clip(&cpu()), &key, None).err().unwrap().to_string();
    assert!(error.contains("without a CLIP"), "{error}");
}
