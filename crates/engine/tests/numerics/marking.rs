//! Real, short markings with a tiny random CLIP: what is learned stays finite, or the job ends in words.
use std::path::{Path, PathBuf};

use guardsplat_engine::clip::{Clip, ClipConfig, ClipModel, Parts};
use guardsplat_engine::embed::{Job, LossTerms, Optimised, Preset, Progress, Settings, embed, optimise};
use guardsplat_engine::error::Error;
use guardsplat_engine::extract::Engine;
use guardsplat_engine::memory::Bytes;
use guardsplat_engine::message::decoder::LayerWeights;
use guardsplat_engine::message::key::Secret;
use guardsplat_engine::message::{ClipIdentity, DecoderWeights, Decoding, Key, Message, Projection};
use guardsplat_engine::sample::sample;
use guardsplat_engine::scene::{BadRows, Gaussians, Scene};
use guardsplat_engine::splat::{MAX_PAIRS, TILE};
use safetensors::tensor::{Dtype, TensorView};

use super::machine::Machine;
use super::scenes::{full_screen, one, ordinary, strange};

/// A CLIP of a few thousand parameters.
pub const TINY: &str = r#"{"embed_dim": 16,
    "vision_cfg": {"image_size": 32, "layers": [1, 1, 1, 1], "width": 8},
    "text_cfg": {"context_length": 5, "vocab_size": 9, "width": 8, "heads": 1, "layers": 1}}"#;

const BITS: usize = 4;

fn message() -> Message {
    Message::parse("6", BITS).unwrap()
}

/// An engine with an untrained decoder, to which `change` was done.
fn engine(machine: &Machine, lpips: Option<PathBuf>, change: impl FnOnce(&mut DecoderWeights)) -> Engine {
    let compute = machine.compute.clone();
    let config = ClipConfig::parse("tiny", TINY).unwrap();
    let model = ClipModel::init(&config, Parts::Image, &compute.device, 5);
    let clip = Clip::from_model(config, String::new(), model);
    let mut projection = Projection::identity(16);
    projection.matrix_image.iter_mut().for_each(|v| *v *= 8.0);
    let mut decoder = DecoderWeights::seeded(16, BITS, 1);
    change(&mut decoder);
    let key = Key {
        secret: Secret::from_seed(1),
        coded_bits: None,
        bits_per_token: 1,
        seed: None,
        clip: ClipIdentity {
            name: String::new(),
            hash: String::new(),
        },
        decoding: Decoding::Clip { projection, decoder },
        accuracy_unseen: None,
        accuracy_unseen_noisy: None,
    };
    Engine::new(compute, clip, &key, lpips).unwrap()
}

/// A preset with few, small views and steps.
fn short(preset: Preset) -> Settings {
    let mut settings = preset.settings();
    (settings.seed, settings.steps) = (3, 3);
    (settings.views_per_step, settings.fresh_per_step, settings.pool_views) = (2, 1, 4);
    (settings.size, settings.enlarged) = (32, settings.enlarged.min(2.0));
    (settings.verify.views, settings.verify.message_views) = (2, 1);
    settings.verify.size = Some(32);
    if let Some(stop) = &mut settings.early_stop {
        (stop.every, stop.views) = (2, 2);
    }
    settings
}

/// Marks a scene in memory; every term of every step and all that is learned must be finite.
fn mark(engine: &Engine, gaussians: Gaussians, settings: &Settings) -> Optimised {
    let mut terms: Vec<LossTerms> = Vec::new();
    let scene = Scene::from_gaussians(gaussians);
    let done = optimise(engine, &scene, &message(), settings, &[], &mut |progress| {
        if let Progress::Step(step) = progress {
            terms.push(step.terms);
        }
    })
    .unwrap();
    assert_eq!(terms.len(), done.steps);
    for t in terms {
        let all = [t.l1, t.ssim, t.lpips.unwrap_or(0.0), t.message, t.offset];
        assert!(all.iter().all(|v| v.is_finite()), "{t:?}");
        assert!(settings.lambda.lpips == 0.0 || t.lpips.is_some());
    }
    assert!(done.learned.values.iter().all(|v| v.is_finite()));
    done
}

pub fn one_gaussian(machine: &Machine) {
    let engine = engine(machine, None, |_| ());
    let scene = one(|_| ());
    let done = mark(&engine, scene.clone(), &short(Preset::Draft));
    assert_eq!(done.learned.changed(&scene.sh), 1);
}

/// Over white, what is brighter than white is clamped everywhere, and nothing is learned; over black its edges are not.
/// What is darker than black is clamped before it is drawn, and has no gradient over either.
pub fn backgrounds(machine: &Machine) {
    let engine = engine(machine, None, |_| ());
    let learned = |constant: f32, black: f32| {
        let mut g = ordinary(60, 0);
        g.sh.coefficients.fill(constant);
        let mut settings = short(Preset::Standard);
        (settings.steps, settings.black_backgrounds) = (2, black);
        (settings.balance, settings.early_stop) = (None, None);
        mark(&engine, g, &settings).learned.values
    };
    assert!(learned(20.0, 0.0).iter().all(|v| *v == 0.0));
    assert!(learned(20.0, 1.0).iter().any(|v| *v != 0.0));
    for black in [0.0, 1.0] {
        assert!(learned(-20.0, black).iter().all(|v| *v == 0.0));
        assert!(learned(0.0, black).iter().any(|v| *v != 0.0));
    }
}

/// Transparent ones, by the sparse steps of `standard` and by those of `paper`, which go to every learned row.
pub fn unseen(machine: &Machine) {
    let folder = tempfile::tempdir().unwrap();
    let lpips = lpips_weights(folder.path(), 1.0);
    let engine = engine(machine, Some(lpips), |_| ());
    let mut g = sample(300, 1, 7).unwrap().gaussians;
    let hidden = [0, 17, 299];
    hidden.iter().for_each(|row| g.opacity_logits[*row] = f32::NEG_INFINITY);
    for preset in [Preset::Standard, Preset::Paper] {
        let done = mark(&engine, g.clone(), &short(preset));
        let colours = done.learned.colours(&g.sh).coefficients;
        let stride = g.sh.per_gaussian();
        for row in hidden {
            assert_eq!(done.learned.learnable.slot(row as u32), None);
            let at = row * stride..(row + 1) * stride;
            assert_eq!(colours[at.clone()], g.sh.coefficients[at]);
        }
        assert!(done.learned.changed(&g.sh) > 50);
    }
}

/// Also on a scene of everything that a file may hold, and on one that is white on white, where variances are 0.
pub fn every_preset(machine: &Machine) {
    let folder = tempfile::tempdir().unwrap();
    let lpips = lpips_weights(folder.path(), 1.0);
    let engine = engine(machine, Some(lpips), |_| ());
    let mut white = ordinary(40, 0);
    white.sh.coefficients.fill(0.5 / 0.282_094_8);
    for preset in [Preset::Draft, Preset::Standard, Preset::Paper] {
        for scene in [ordinary(80, 2), strange(80, 1), white.clone()] {
            mark(&engine, scene, &short(preset));
        }
    }
}

/// What the output was before the job, which must still be there after it has failed.
const BEFORE: &[u8] = b"what was there before";

/// Weights that are numbers and whose products are not: each term ends the run with its step and its name, and the file
/// that was there is untouched.
pub fn poison(machine: &Machine) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let scene = sample(200, 1, 7).unwrap();
    scene.write(&at("in.ply"), &scene.gaussians.sh).unwrap();
    std::fs::write(at("out.ply"), BEFORE).unwrap();
    let stops = |engine: &Engine, settings: &Settings, expected: &str| {
        let job = Job {
            bad_rows: BadRows::Refuse,
            input: &at("in.ply"),
            output: &at("out.ply"),
            message: &message(),
            settings,
            cameras: &[],
            force: true,
        };
        let mut steps = 0;
        let result = embed(engine, &job, &mut |progress| {
            steps += usize::from(matches!(progress, Progress::Step(_)));
        });
        let error = result.unwrap_err();
        println!("{error}");
        let told = matches!(&error, Error::NotFinite { step, term, value }
            if *step == steps + 1 && *term == expected && !value.is_finite());
        assert!(told, "{error:?}");
        let words = error.to_string();
        assert!(
            words.contains(expected) && words.contains("nothing was written"),
            "{words}"
        );
        assert_eq!(std::fs::read(at("out.ply")).unwrap(), BEFORE);
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            3,
            "nothing is left aside"
        );
    };
    let scale = |layer: &mut LayerWeights, factor: f32| layer.weight.iter_mut().for_each(|w| *w *= factor);
    let huge = lpips_weights(folder.path(), 1e30);
    for preset in [Preset::Draft, Preset::Standard, Preset::Paper] {
        let mut settings = short(preset);
        settings.lambda.lpips = 0.0;
        let beyond = engine(machine, None, |d| d.layers[1..].iter_mut().for_each(|l| scale(l, 1e25)));
        stops(&beyond, &settings, "message");
        // The loss itself is a number, and its gradient is beyond all.
        settings.lambda.message = 1e9;
        let steep = engine(machine, None, |d| scale(&mut d.layers[2], 1e33));
        stops(&steep, &settings, "gradient");
        let settings = Settings {
            lambda: Preset::Paper.settings().lambda,
            ..short(preset)
        };
        stops(&engine(machine, Some(huge.clone()), |_| ()), &settings, "LPIPS");
    }
}

/// A small file whose views have longer lists than the adapter can bind: as many balls, each on all tiles, as it takes.
/// It is refused before the first step, and before the output is touched.
pub fn too_much_for_the_adapter(machine: &Machine) {
    let mut settings = short(Preset::Standard);
    (settings.size, settings.enlarged) = (480, 1.0);
    let tiles = u64::from((480 / TILE).pow(2));
    let limit = machine.compute.max_buffer.unwrap();
    // Twelve bytes of gradient a (Gaussian, tile) pair.
    let count = limit / (12 * tiles) + 1;
    if count * tiles > MAX_PAIRS {
        return; // no view may have as many pairs as this adapter can hold
    }
    let mut g = full_screen(count as usize);
    g.positions
        .iter_mut()
        .zip(0..)
        .for_each(|(p, i)| p[0] = 1e-3 * i as f32);
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let scene = Scene::from_gaussians(full_screen(count as usize));
    scene.write(&at("in.ply"), &scene.gaussians.sh).unwrap();
    let job = Job {
        bad_rows: BadRows::Refuse,
        input: &at("in.ply"),
        output: &at("out.ply"),
        message: &message(),
        settings: &settings,
        cameras: &[],
        force: true,
    };
    let mut told = 0;
    let error = embed(&engine(machine, None, |_| ()), &job, &mut |_| told += 1).unwrap_err();
    println!("{error}");
    assert!(matches!(error, Error::DoesNotFit { .. }), "{error}");
    assert!(error.to_string().contains(&Bytes(limit).to_string()));
    assert_eq!(told, 0, "not even admitted");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Weights for LPIPS, random and of the usual spread times `factor`: published ones are no part of the repository.
fn lpips_weights(folder: &Path, factor: f32) -> PathBuf {
    let shapes = [
        [64, 3, 11, 11],
        [192, 64, 5, 5],
        [384, 192, 3, 3],
        [256, 384, 3, 3],
        [256, 256, 3, 3],
    ];
    let mut state = 1u64;
    let mut random = |count: usize, low: f32, high: f32| -> Vec<u8> {
        let values = (0..count).flat_map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let unit = (state >> 40) as f32 / (1u64 << 24) as f32;
            (low + (high - low) * unit).to_le_bytes()
        });
        values.collect()
    };
    let mut tensors = Vec::new();
    for (i, shape) in shapes.into_iter().enumerate() {
        let fan_in: usize = shape[1..].iter().product();
        let bound = factor * (6.0 / fan_in as f32).sqrt();
        let weight = random(shape.iter().product(), -bound, bound);
        tensors.push((format!("features.conv{i}.weight"), shape.to_vec(), weight));
        tensors.push((
            format!("features.conv{i}.bias"),
            vec![shape[0]],
            random(shape[0], -0.1, 0.1),
        ));
        let head = random(shape[0], 0.0, 1.0 / shape[0] as f32);
        tensors.push((format!("lin{i}.weight"), vec![1, shape[0], 1, 1], head));
    }
    let views = tensors.iter().map(|(name, shape, bytes)| {
        (
            name.as_str(),
            TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap(),
        )
    });
    let path = folder.join("lpips.safetensors");
    std::fs::write(&path, safetensors::serialize(views, None).unwrap()).unwrap();
    path
}
