//! A scene with a mark of 64 bits, and what is left of it: for attacks that take minutes and are run by people.
use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::{DEFAULT_VIEWS, Engine, default_size, read_scene};
use guardsplat_engine::message::{Key, Message};
use guardsplat_engine::quality::measure;
use guardsplat_engine::scene::{Gaussians, Scene};
use guardsplat_engine::splat::Geometry;
use guardsplat_engine::view::{Split, ViewSampler};
use guardsplat_tests::{TestEnvironment, real_scene};

/// What is marked.
pub const SCENE: &str = "playbot_31k.ply";
const WORD: &str = "5c1d9e20f7a8346b";
const WHITE: [f32; 3] = [1.0; 3];

/// The owner's, and what the attacker has of it.
pub struct Attacked {
    pub engine: Engine,
    pub message: Message,
    pub original: Gaussians,
    pub marked: Gaussians,
    /// The folder of it all.
    pub environment: TestEnvironment,
}

/// What an attack left.
pub struct Left {
    /// Of 64.
    pub bits: u32,
    pub p_value: f64,
    /// Mean PSNR of views against those of the marked scene, which is what an attacker can compare with, and against the
    /// original's.
    pub psnr_to_marked: f64,
    pub psnr_to_original: f64,
}

impl std::fmt::Display for Left {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} of 64 bits, p {:.1e}, {:.1} dB to the marked scene, {:.1} dB to the original",
            self.bits, self.p_value, self.psnr_to_marked, self.psnr_to_original
        )
    }
}

/// Marks a scene with a key of seed `key`; returns the marked file's name.
pub fn mark(environment: &TestEnvironment, from: &str, key: u64, word: &str) -> String {
    let to = format!("{key}-{from}");
    environment.exits(
        &format!("key create --bits 64 --seed {key} -o {key}.key --device cpu"),
        0,
    );
    let line = format!("embed {from} {to} --key {key}.key --message {word} --force --device cpu --json");
    let output = environment.run(&line);
    assert!(matches!(output.status.code(), Some(0 | 3)), "{line}");
    to
}

/// The scene of a file.
pub fn scene(environment: &TestEnvironment, name: &str) -> Gaussians {
    Scene::read(&environment.path(name)).unwrap().into_gaussians()
}

impl Attacked {
    /// Marks the scene, preset `standard`; `None` without the scene.
    pub fn new() -> Option<Self> {
        let environment = TestEnvironment::new();
        environment.write("in.ply", std::fs::read(real_scene(SCENE)?).unwrap());
        let marked = mark(&environment, "in.ply", 1, WORD);
        let key = Key::read(&environment.path("1.key")).unwrap();
        let compute = open(DeviceChoice::Cpu).unwrap();
        let clip = Clip::shipped(&compute.device, Parts::Image).unwrap();
        Some(Self {
            engine: Engine::new(compute, clip, &key, None).unwrap(),
            message: key.message(WORD).unwrap(),
            original: scene(&environment, "in.ply"),
            marked: scene(&environment, &marked),
            environment,
        })
    }

    /// Reads a scene as a claim does that costs one hypothesis, and compares what it looks like.
    pub fn left(&self, scene: &Gaussians) -> Left {
        let size = default_size(&self.engine);
        let read = {
            let sampler = ViewSampler::new(scene, 0).unwrap();
            read_scene(&self.engine, scene, &sampler, DEFAULT_VIEWS, size, WHITE, |_, _| Ok(())).unwrap()
        };
        let decision = read
            .compare(
                &self.engine.message_code,
                &self.message,
                &self.engine.acceptance_rule(1),
            )
            .unwrap()
            .decision;
        Left {
            bits: decision.matched_bits,
            p_value: decision.p_value,
            psnr_to_marked: self.psnr(&self.marked, scene),
            psnr_to_original: self.psnr(&self.original, scene),
        }
    }

    fn psnr(&self, one: &Gaussians, other: &Gaussians) -> f64 {
        // The same cameras for both, and views that nobody else uses.
        let sampler = ViewSampler::new(&self.original, 77).unwrap();
        let pairs: Vec<_> = (0..8)
            .map(|index| {
                let camera = sampler.camera(Split::HeldOut, index, default_size(&self.engine));
                let [one, other] =
                    [one, other].map(|scene| self.engine.picture(&Geometry::new(scene), &camera, WHITE).unwrap());
                (one, other)
            })
            .collect();
        let quality = measure(&pairs, None, &self.engine.compute.device, &self.engine.stop).unwrap();
        quality.psnr.psnr_db.unwrap_or(f64::INFINITY)
    }
}
