//! What is measured of a sample scene: jobs as the other commands carry them out, and the steps of embeddings.
use std::path::{Path, PathBuf};

use guardsplat_codeword::Message;
use guardsplat_distortion::RobustTo;
use guardsplat_engine::clip::ShippedClip;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::embed::{Job, Preset, Progress, Settings, StepTimes, embed_with_files};
use guardsplat_engine::extract::{DEFAULT_VIEWS, Engine, find_source};
use guardsplat_engine::message::{Key, KeyOptions, TrainingOptions};
use guardsplat_engine::quality::write_picture;
use guardsplat_engine::sample::sample;
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::splat::Geometry;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::view::{Split, ViewSampler};
use guardsplat_engine::{Error, Result};
use serde::Serialize;
use tempfile::TempDir;

use super::Arguments;
use super::spread::Spread;
use crate::cli::display::Display;
use crate::machine::Machine;
use guardsplat_operations::comparison::read_and_compare;
use guardsplat_operations::suspect::Suspect;
use guardsplat_operations::verification::Views;
use guardsplat_operations::{create_key, load};

/// Bits of the key, and its seed: seconds don't depend on it.
const BITS: usize = 32;
const SEED: u64 = 7;
/// Degree of the sample scenes' spherical harmonics.
const DEGREE: usize = 3;
/// Side of the picture that is verified, as people make them.
const PICTURE: u32 = 800;

/// What is the same for all scenes.
pub struct Given {
    pub engine: Engine,
    pub clip: String,
    message: Message,
    presets: Vec<(Preset, Settings)>,
    repetitions: u32,
    folder: TempDir,
}

impl Given {
    pub fn new(arguments: &Arguments) -> Result<Self> {
        let json = arguments
            .settings
            .as_ref()
            .map(|path| std::fs::read_to_string(path).map_err(Error::io(path)));
        let json = json.transpose()?;
        let settings = |preset: &Preset| {
            let settings = preset.settings();
            let settings = json.as_ref().map_or(Ok(settings), |json| settings.overridden(json))?;
            Ok((*preset, settings))
        };
        let folder = tempfile::tempdir().map_err(Error::io(&std::env::temp_dir()))?;
        let (path, key) = match &arguments.key {
            Some(path) => (path.clone(), Key::read(path)?),
            None => (folder.path().join("key"), made(arguments.device)?),
        };
        // Without LPIPS, which some have and others don't.
        let engine = load::engine(
            &path,
            &key,
            None,
            arguments.device,
            load::Work::Marking,
            false,
            arguments.budget.bytes(),
        )?;
        let digits = key.bits().div_ceil(4);
        Ok(Self {
            // The first digit may have only one bit.
            message: key.message(&format!("1{}", "5".repeat(digits - 1)))?,
            presets: arguments.presets.iter().map(settings).collect::<Result<_>>()?,
            repetitions: arguments.repetitions,
            clip: key.clip.name,
            engine,
            folder,
        })
    }
}

/// A key for the newest shipped CLIP.
fn made(device: DeviceChoice) -> Result<Key> {
    let options = KeyOptions {
        bits: BITS,
        coded: true,
        bits_per_token: None,
        seed: Some(SEED),
        robust_to: RobustTo::none(),
        training: TrainingOptions::default(),
    };
    let overrides = create_key::ProjectionOverrides::default();
    let compute = load::device(device, ShippedClip::NEWEST, load::Work::Reading)?;
    create_key::create(&options, overrides, None, &compute, &Stop::default(), |_| {})
}

/// How long things take with one scene.
#[derive(Serialize)]
pub struct Case {
    pub gaussians: usize,
    pub sh_degree: usize,
    pub jobs: Vec<Timed>,
    pub steps: Vec<Steps>,
}

/// A job from its file to its outcome, with what is loaded once for all jobs loaded before.
#[derive(Serialize)]
pub struct Timed {
    pub name: String,
    pub seconds: Spread,
    /// Of all processors together, where the system tells.
    pub processor_seconds: Option<Spread>,
    /// Ways in which a picture was looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub framings: Option<usize>,
}

/// The steps of all embeddings with a preset.
#[derive(Serialize)]
pub struct Steps {
    pub preset: &'static str,
    pub views: usize,
    pub size: u32,
    /// Milliseconds of a step without its look at held-out views.
    #[serde(rename = "milliseconds")]
    pub whole: Spread,
    pub stages: Vec<(&'static str, Spread)>,
}

impl Case {
    /// Measures a sample scene of that size.
    pub fn measure(given: &Given, machine: &Machine, gaussians: usize) -> Result<Self> {
        let scene = Files::make(given, gaussians)?;
        let mut clocks: Vec<Clock> = Vec::new();
        let mut times: Vec<Vec<StepTimes>> = vec![Vec::new(); given.presets.len()];
        let mut display = Display::new("measuring");
        for repetition in 0..given.repetitions {
            // In turns, so that whatever else the machine does disturbs all alike.
            let mut clock = Turn {
                clocks: &mut clocks,
                machine,
                next: 0,
            };
            for ((preset, settings), times) in given.presets.iter().zip(&mut times) {
                clock.run(&format!("embed {}", preset.name()), || {
                    scene.embed(given, settings, times)
                })?;
            }
            clock.run("verify scene", || scene.verify(given, &scene.input))?;
            clock.run("verify picture", || scene.verify(given, &scene.picture))?;
            display.set(repetition as usize + 1, given.repetitions as usize, || {
                format!("{gaussians} Gaussians")
            });
        }
        display.finish();
        let steps = given.presets.iter().zip(times);
        Ok(Self {
            gaussians,
            sh_degree: DEGREE,
            jobs: clocks.into_iter().filter_map(Clock::told).collect(),
            steps: steps
                .filter_map(|((preset, settings), times)| Steps::of(*preset, settings, &times))
                .collect(),
        })
    }
}

impl Steps {
    fn of(preset: Preset, settings: &Settings, times: &[StepTimes]) -> Option<Self> {
        type Stage = (&'static str, fn(&StepTimes) -> f64);
        let stages: [Stage; 7] = [
            ("prepare views", |t| t.prepare),
            ("colours", |t| t.colours),
            ("rasterise", |t| t.render),
            ("loss and gradient", |t| t.loss),
            ("backward", |t| t.backward),
            ("spherical harmonics backward", |t| t.sh_backward),
            ("optimiser", |t| t.optimiser),
        ];
        let whole = |t: &StepTimes| stages.iter().map(|(_, of)| of(t)).sum();
        let spread = |of: &dyn Fn(&StepTimes) -> f64| Spread::of(times.iter().map(of).collect());
        Some(Self {
            preset: preset.name(),
            views: settings.views_per_step,
            size: settings.size,
            whole: spread(&whole)?,
            stages: stages
                .iter()
                .filter_map(|(name, of)| Some((*name, spread(of)?)))
                .collect(),
        })
    }
}

/// The files of a sample scene.
struct Files {
    input: PathBuf,
    output: PathBuf,
    picture: PathBuf,
}

impl Files {
    fn make(given: &Given, gaussians: usize) -> Result<Self> {
        let at = |name: &str| given.folder.path().join(name);
        let files = Self {
            input: at("in.ply"),
            output: at("out.ply"),
            picture: at("view.png"),
        };
        let scene = sample(gaussians, DEGREE, SEED)?;
        scene.write(&files.input, &scene.gaussians.sh)?;
        let gaussians = &scene.gaussians;
        let camera = ViewSampler::new(gaussians, SEED)?.camera(Split::HeldOut, 0, PICTURE);
        let picture = given.engine.picture(&Geometry::new(gaussians), &camera, [1.0; 3])?;
        write_picture(&files.picture, &picture)?;
        Ok(files)
    }

    fn embed(&self, given: &Given, settings: &Settings, times: &mut Vec<StepTimes>) -> Result<Option<usize>> {
        let job = Job {
            input: &self.input,
            output: &self.output,
            message: &given.message,
            settings,
            cameras: &[],
            force: true,
            bad_rows: BadRows::Refuse,
        };
        embed_with_files(&given.engine, &job, &mut |progress| {
            if let Progress::Timed(step) = progress {
                times.push(step);
            }
        })?;
        Ok(None)
    }

    /// Of the unmarked scene: no framing of its picture matches, so all are tried.
    fn verify(&self, given: &Given, path: &Path) -> Result<Option<usize>> {
        let views = Views {
            count: DEFAULT_VIEWS,
            size: None,
            background: [1.0; 3],
            seed: 0,
            cameras: Vec::new(),
            kind: None,
            bad_rows: BadRows::Refuse,
            with_files: true,
            level: 0,
        };
        let suspect = Suspect::from(find_source(&[path.to_owned()])?);
        let found = read_and_compare(&given.engine, &suspect, &views, None, Some(&given.message), |_, _| {})?;
        Ok((!suspect.pictures.is_empty()).then_some(found.ways))
    }
}

/// What was measured of a job so far.
struct Clock {
    name: String,
    seconds: Vec<f64>,
    processor: Vec<f64>,
    framings: Option<usize>,
}

impl Clock {
    fn told(self) -> Option<Timed> {
        Some(Timed {
            seconds: Spread::of(self.seconds)?,
            processor_seconds: Spread::of(self.processor),
            name: self.name,
            framings: self.framings,
        })
    }
}

/// One turn through all jobs.
struct Turn<'a> {
    clocks: &'a mut Vec<Clock>,
    machine: &'a Machine,
    next: usize,
}

impl Turn<'_> {
    /// Measures the next job; what it returns is how many framings it tried.
    fn run(&mut self, name: &str, job: impl FnOnce() -> Result<Option<usize>>) -> Result<()> {
        let stopwatch = self.machine.stopwatch();
        let framings = job()?;
        let (seconds, timing) = stopwatch.stop();
        if self.clocks.len() == self.next {
            self.clocks.push(Clock {
                name: name.to_owned(),
                seconds: Vec::new(),
                processor: Vec::new(),
                framings,
            });
        }
        let clock = &mut self.clocks[self.next];
        clock.seconds.push(seconds);
        clock.processor.extend(timing.processor_seconds);
        self.next += 1;
        Ok(())
    }
}
