//! The engine as a whole, on a tiny CLIP with random weights: embedding from file to file, and reading back.
use std::path::Path;
use std::sync::OnceLock;

use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::Tensor;
use guardsplat_distortion::RobustTo;
use guardsplat_engine::clip::{Clip, ClipConfig, ClipModel, Parts};
use guardsplat_engine::device::Compute;
use guardsplat_engine::embed::{Augmentation, Job, Outcome, Preset, Progress, Settings, embed, optimise};
use guardsplat_engine::extract::{Engine, rasterizer, read_rendered, read_scene};
use guardsplat_engine::message::key::{KeyProgress, create_key, natural_images};
use guardsplat_engine::message::{ClipIdentity, FitOptions, Key, KeyOptions, Message, TrainingOptions};
use guardsplat_engine::sample::sample;
use guardsplat_engine::scene::{BadRows, Gaussians, Scene};
use guardsplat_engine::splat::Geometry;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::testing::{scene_path, wgpu};
use guardsplat_engine::view::{Split, ViewSampler};
use guardsplat_engine::{Error, Result};

#[path = "engine/extractors.rs"]
mod extractors;
#[path = "engine/stopping.rs"]
mod stopping;
#[path = "engine/targets.rs"]
mod targets;

use guardsplat_engine::testing::tiny::{TINY, cpu, model};

const BITS: usize = 8;

fn clip(compute: &Compute) -> Clip {
    let (config, model) = model(compute);
    Clip::from_model(config, "00".repeat(32), model)
}

fn new_key(compute: &Compute, seed: u64) -> Result<Key> {
    new_key_until(compute, seed, &Stop::default(), |_| {})
}

fn new_key_until(compute: &Compute, seed: u64, stop: &Stop, progress: impl FnMut(KeyProgress)) -> Result<Key> {
    let options = KeyOptions {
        bits: BITS,
        coded: false,
        bits_per_token: None,
        seed: Some(seed),
        robust_to: RobustTo::none(),
        training: TrainingOptions {
            noise: 0.2,
            ..TrainingOptions::default()
        },
    };
    let fit = FitOptions {
        remove: 2,
        keep: None,
        ranked: false,
    };
    let identity = ClipIdentity {
        name: "tiny".into(),
        hash: "00".repeat(32),
    };
    let pictures = natural_images::pictures(rasterizer(compute)?, 32)?.step_by(5);
    create_key(
        &options,
        fit,
        &clip(compute),
        identity,
        compute,
        pictures,
        stop,
        progress,
    )
}

fn key() -> &'static Key {
    static KEY: OnceLock<Key> = OnceLock::new();
    KEY.get_or_init(|| new_key(&cpu(), 1).unwrap())
}

fn engine() -> Engine {
    let compute = cpu();
    let clip = clip(&compute);
    Engine::new(compute, clip, key(), None).unwrap()
}

fn message() -> Message {
    key().message("5c").unwrap()
}

/// Few and small views, without any of the controls.
fn settings() -> Settings {
    let draft = Preset::Draft.settings();
    let mut settings = Settings {
        seed: 3,
        steps: 4,
        views_per_step: 4,
        fresh_per_step: 2,
        pool_views: 6,
        size: 32,
        balance: None,
        early_stop: None,
        augmentation: Augmentation {
            brightness: 0.05,
            scale: 0.05,
            shift: 0.02,
        },
        ..draft
    };
    (settings.verify.views, settings.verify.message_views) = (4, 2);
    settings.verify.size = Some(32);
    settings.target.bit_accuracy = 0.0;
    settings.target.psnr_db = 0.0;
    settings.target.message = false;
    settings
}

fn small_scene() -> Gaussians {
    sample(600, 1, 7).unwrap().gaussians
}

/// A scene file in a folder of its own.
fn scene_file() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.ply");
    let scene = sample(600, 1, 7).unwrap();
    scene.write(&path, &scene.gaussians.sh).unwrap();
    (folder, path)
}

fn run(engine: &Engine, input: &Path, output: &Path, settings: &Settings, force: bool) -> Result<Outcome> {
    let job = Job {
        input,
        output,
        message: &message(),
        settings,
        cameras: &[],
        force,
        bad_rows: BadRows::Refuse,
    };
    embed(engine, &job, &mut |_| {})
}

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_loss_falls_on_training_views() {
    let (engine, scene) = (engine(), Scene::from_gaussians(small_scene()));
    let mut settings = Settings {
        steps: 60,
        ..settings()
    };
    // A random tower hardly sees anything, and nothing that carries over to other views: so the message weighs more
    // than pictures do, and the views stay the same.
    (settings.lambda.message, settings.lambda.reconstruction) = (1.0, 0.1);
    (settings.views_per_step, settings.fresh_per_step) = (4, 0);
    settings.augmentation = Augmentation {
        brightness: 0.0,
        scale: 0.0,
        shift: 0.0,
    };
    let (mut losses, mut accuracies) = (Vec::new(), Vec::new());
    let done = optimise(&engine, &scene, &message(), &settings, &[], &mut |progress| {
        if let Progress::Step(step) = progress {
            losses.push(step.terms.message);
            accuracies.push(step.bit_accuracy);
        }
    })
    .unwrap();
    assert_eq!((losses.len(), done.view_steps), (60, 240));
    assert!(losses[59] < 0.8 * losses[0], "from {} to {}", losses[0], losses[59]);
    assert!(accuracies[59] > accuracies[0], "{accuracies:?}");
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_a_file_that_reads_as_verified() {
    let ((folder, input), engine) = (scene_file(), engine());
    let at = |name: &str| folder.path().join(name);
    let outcome = run(&engine, &input, &at("a.ply"), &settings(), false).unwrap();
    run(&engine, &input, &at("b.ply"), &settings(), false).unwrap();
    let other = Settings { seed: 4, ..settings() };
    run(&engine, &input, &at("c.ply"), &other, false).unwrap();
    let bytes = |name: &str| std::fs::read(at(name)).unwrap();
    assert!(bytes("a.ply") == bytes("b.ply"));
    assert!(bytes("a.ply") != bytes("c.ply") && bytes("a.ply") != bytes("in.ply"));
    assert_eq!(files(folder.path()), ["a.ply", "b.ply", "c.ply", "in.ply"]);

    assert!(outcome.written && outcome.missed.is_empty());
    assert_eq!((outcome.steps, outcome.view_steps), (4, 16));
    assert!(outcome.changed > 100 && outcome.changed <= outcome.gaussians);
    // What was verified is what anyone reads from the file.
    let scene = Scene::read(&at("a.ply")).unwrap().gaussians;
    let reading = read_scene(
        &engine,
        &scene,
        &ViewSampler::new(&scene, 3).unwrap(),
        4,
        32,
        [1.0; 3],
        |_, _| Ok(()),
    )
    .unwrap();
    let found = &outcome.verification;
    assert_eq!(
        reading
            .compare(&engine.message_code, &message(), &engine.acceptance_rule(1))
            .unwrap(),
        found.comparison
    );
    let sampler = ViewSampler::new(&scene, 3).unwrap();
    let camera = sampler.camera(Split::HeldOut, 0, 32);
    let first = engine.picture(&Geometry::new(&scene), &camera, [1.0; 3]).unwrap();
    assert_eq!(found.pairs[0].1, first);
    // It is read as one of 800 px.
    let read = engine.averaged_picture(&Geometry::new(&scene), &camera, 25.0, [1.0; 3]);
    assert_eq!(read_rendered(&engine, &[read.unwrap()]).unwrap()[0], reading.views[0]);
    assert!(found.quality.psnr.psnr_db.unwrap() > 20.0);
}

#[test]
fn what_a_mark_is_to_stand_changes_its_training_and_nothing_else() {
    let ((folder, input), engine) = (scene_file(), engine());
    let at = |name: &str| folder.path().join(name);
    let robust_to = |list: &str| Settings {
        robust_to: list.parse().unwrap(),
        ..settings()
    };
    let run = |name: &str, list: &str| {
        let outcome = run(&engine, &input, &at(name), &robust_to(list), false).unwrap();
        assert!(outcome.changed > 100, "{list}");
        std::fs::read(at(name)).unwrap()
    };
    let plain = run("none.ply", "none");
    assert!(plain == run("again.ply", "none"));
    // Of pictures, of scenes, and both.
    let lists = ["jpeg,rotation,noise,crop", "sh-truncation,pruning,sh-noise,spz", "all"];
    for list in lists {
        let robust = run("robust.ply", list);
        assert!(robust != plain && robust == run("again.ply", list), "{list}");
    }
}

#[test]
fn gaussians_that_no_view_sees_keep_their_colours() {
    let (engine, mut scene) = (engine(), small_scene());
    for row in [0, 17, 599] {
        scene.opacity_logits[row] = f32::NEG_INFINITY;
    }
    let original = scene.sh.clone();
    let stride = original.per_gaussian();
    let scene = Scene::from_gaussians(scene);
    let done = optimise(&engine, &scene, &message(), &settings(), &[], &mut |_| {}).unwrap();
    let learnable = &done.learned.learnable;
    assert!(learnable.rows().len() > 100 && learnable.rows().len() <= 597);
    // They take no memory either.
    assert_eq!(done.learned.values.len(), learnable.rows().len() * stride);
    let colours = done.learned.colours(&original);
    for row in 0..600 {
        let at = row * stride..(row + 1) * stride;
        let same = colours.coefficients[at.clone()] == original.coefficients[at.clone()];
        assert!(same || learnable.slot(row as u32).is_some());
        assert!(![0, 17, 599].contains(&row) || same);
        assert!(colours.coefficients[at].iter().all(|o| o.is_finite()));
    }
}

#[test]
fn scenes_without_view_dependence_and_without_anything_to_see() {
    let engine = engine();
    let scene = sample(300, 0, 7).unwrap();
    let done = optimise(&engine, &scene, &message(), &settings(), &[], &mut |_| {}).unwrap();
    assert!(done.learned.values.iter().any(|o| *o != 0.0));
    // Nothing visible: nothing to learn, and no NaN from it.
    let mut scene = scene.gaussians;
    scene.opacity_logits.fill(f32::NEG_INFINITY);
    let scene = Scene::from_gaussians(scene);
    let done = optimise(&engine, &scene, &message(), &settings(), &[], &mut |_| {}).unwrap();
    assert!(done.learned.values.is_empty());
    // Nothing at all.
    let empty = optimise(
        &engine,
        &Scene::from_gaussians(Gaussians::default()),
        &message(),
        &settings(),
        &[],
        &mut |_| {},
    );
    assert!(empty.is_err());
}

struct Poison;

impl ModuleMapper for Poison {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(|tensor| tensor * f32::NAN)
    }
}

#[test]
fn weights_that_are_no_numbers_stop_the_run_with_step_and_term() {
    let ((folder, input), compute) = (scene_file(), cpu());
    let (config, model) = model(&compute);
    let clip = Clip::from_model(config, "00".repeat(32), model.map(&mut Poison));
    let engine = Engine::new(compute, clip, key(), None).unwrap();
    let error = run(&engine, &input, &folder.path().join("out.ply"), &settings(), true).unwrap_err();
    let found = matches!(&error, Error::NotFinite { step: 1, term: "message", value } if value.is_nan());
    assert!(found, "{error}");
    assert_eq!(files(folder.path()), ["in.ply"]);
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let (engine, scene) = (engine(), Scene::from_gaussians(small_scene()));
    let long = Message::parse("5c5c", 16).unwrap();
    let refused = |message: &Message, settings: &Settings| {
        let result = optimise(&engine, &scene, message, settings, &[], &mut |_| {});
        result.unwrap_err().to_string()
    };
    assert!(refused(&long, &settings()).contains("16 bits, but the key has 8"));
    let none = Settings { steps: 0, ..settings() };
    assert!(refused(&message(), &none).starts_with("steps: 0 is outside 1"));
    let compute = cpu();
    let other = TINY.replace("\"embed_dim\": 16", "\"embed_dim\": 12");
    let config = ClipConfig::parse("other", &other).unwrap();
    let model = ClipModel::init(&config, Parts::Image, &compute.device, 5);
    let clip = Clip::from_model(config, "11".repeat(32), model);
    let error = Engine::new(compute, clip, key(), None).err().unwrap();
    assert!(error.to_string().contains("12 dimensions, the key reads 16"));
}

#[test]
fn a_seed_decides_the_whole_key() {
    assert_eq!(new_key(&cpu(), 1).unwrap().id(), key().id());
    assert_ne!(new_key(&cpu(), 2).unwrap().id(), key().id());
}

#[test]
fn a_whole_embedding_runs_on_wgpu() {
    let Some(input) = scene_path("playbot_8k.ply") else {
        return;
    };
    let Some(compute) = wgpu() else { return };
    let clip = clip(&compute);
    let engine = Engine::new(compute, clip, key(), None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings();
    (settings.steps, settings.views_per_step, settings.verify.views) = (3, 2, 2);
    let at = |name: &str| folder.path().join(name);
    let outcome = run(&engine, &input, &at("a.ply"), &settings, false).unwrap();
    assert!(outcome.written && outcome.changed > 1000);
    run(&engine, &input, &at("b.ply"), &settings, false).unwrap();
    assert!(std::fs::read(at("a.ply")).unwrap() == std::fs::read(at("b.ply")).unwrap());
}
