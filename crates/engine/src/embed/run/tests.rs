use super::*;
use crate::clip::{Clip, ClipConfig, ClipModel, Parts};
use crate::device::{DeviceChoice, open};
use crate::embed::view_pool::ViewPool;
use crate::embed::{Augmentation, Preset};
use crate::message::key::Secret;
use crate::message::{ClipIdentity, DecoderWeights, Decoding, Key, Projection};
use crate::sample::sample;
use crate::splat::Geometry;
use crate::view::ViewSampler;
use rand::RngExt;

const TINY: &str = r#"{"embed_dim": 16,
    "vision_cfg": {"image_size": 32, "layers": [1, 1, 1, 1], "width": 8},
    "text_cfg": {"context_length": 5, "vocab_size": 9, "width": 8, "heads": 1, "layers": 1}}"#;

/// A tiny random CLIP and an untrained decoder.
pub(in crate::embed) fn engine() -> Engine {
    let compute = open(DeviceChoice::Cpu).unwrap();
    let config = ClipConfig::parse("tiny", TINY).unwrap();
    let model = ClipModel::init(&config, Parts::Image, &compute.device, 5);
    let clip = Clip::from_model(config, String::new(), model);
    let mut projection = Projection::identity(16);
    projection.matrix_image.iter_mut().for_each(|v| *v *= 8.0);
    let key = Key {
        secret: Secret::from_seed(1),
        coded_bits: None,
        bits_per_token: 1,
        seed: None,
        clip: ClipIdentity {
            name: String::new(),
            hash: String::new(),
        },
        decoding: Decoding::Clip {
            projection,
            decoder: DecoderWeights::seeded(16, 4, 1),
        },
        accuracy_unseen: None,
        accuracy_unseen_noisy: None,
    };
    Engine::new(compute, clip, &key, None).unwrap()
}

/// Along its own direction the gradient must be as steep as its length, from pictures back to coefficients.
#[test]
fn the_gradient_is_that_of_the_loss() {
    let engine = engine();
    let scene = sample(300, 2, 3).unwrap();
    let message = Message::parse("6", 4).unwrap();
    let mut settings = Preset::Draft.settings();
    (settings.views_per_step, settings.size, settings.enlarged) = (2, 40, 1.0);
    let l = &mut settings.lambda;
    (l.l1, l.l2, l.ssim) = (0.8, 0.0, 0.2);
    settings.augmentation = Augmentation {
        brightness: 0.0,
        ..settings.augmentation
    };
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let start: Vec<f32> = (0..scene.gaussians.sh.coefficients.len())
        .map(|_| 0.2 * (rng.random::<f32>() - 0.5))
        .collect();
    for (message_weight, weight) in [(1.0, 0.0), (0.0, 1.0), (0.5, 2.0)] {
        (settings.lambda.message, settings.lambda.reconstruction) = (message_weight, weight);
        let geometry = Geometry::new(&scene.gaussians);
        let sampler = ViewSampler::new(&scene.gaussians, 1).unwrap();
        let mut pool = ViewPool::new(sampler, &settings);
        let coverage = pool.cover(&engine, &geometry).unwrap();
        let mut run = Run::new(&engine, &scene, &message, &settings, &coverage, false).unwrap();
        let views = pool.batch(&engine, &geometry).unwrap();
        // Offsets of Gaussians that no view shows have no slot.
        let columns = run.learned.learnable.columns();
        let start = start[..coverage.count() * columns].to_vec();
        let mut at = |offsets: Vec<f32>| {
            run.learned.values = offsets;
            run.gradient.fill(0.0);
            // The same augmentation every time.
            run.augmentation = ChaCha8Rng::seed_from_u64(4);
            let t = run
                .differentiate(1, &views, &mut StepTimer::new(), || Ok(()))
                .unwrap()
                .terms;
            let l = &settings.lambda;
            let reconstruction = l.l1 * t.l1 + l.ssim * t.ssim;
            let loss = l.message * t.message + l.reconstruction * reconstruction;
            (f64::from(loss), run.gradient.clone())
        };
        let (_, gradient) = at(start.clone());
        let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
        assert!(length > 0.0);
        let mut moved = |step: f32| {
            let pairs = start.iter().zip(&gradient);
            at(pairs.map(|(o, g)| o + step * g / length).collect()).0
        };
        // A large step crosses kinks of the tower, a small one drowns in rounding: some step in between agrees.
        let ratio = |step: f32| {
            let slope = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
            slope / f64::from(length)
        };
        let ratios = [0.02, 0.01, 0.005, 0.0025].map(ratio);
        let off = ratios.iter().map(|r| (r - 1.0).abs()).fold(f64::INFINITY, f64::min);
        assert!(off < 0.02, "{message_weight} {weight}: {ratios:?}");
    }
}
