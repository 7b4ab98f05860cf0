//! Does what a plan wants and the store does not have yet.
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use guardsplat_distortion::Vae;
use guardsplat_evaluation::report::names;
use guardsplat_evaluation::report::record::{Embedding, Id, Record};
use guardsplat_evaluation::report::store::Store;
use rand::SeedableRng;
use rand_chacha::ChaCha20Rng;
use sha2::{Digest, Sha256};

use super::claims::ClaimTrials;
use super::mark::{Marking, path};
use super::plan::{Plan, WantedMark};
use super::read::{Views, cameras};
use super::steganalysis::{Marked, SteganalysisRun};
use super::trials::TrialRun;
use crate::error::{Error, Result};
use crate::machine::Machine;
use guardsplat_engine::embed;
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::{Key, Message};
use guardsplat_engine::scene::Scene;

/// Over what a plan is carried out.
#[derive(Clone, Debug)]
pub struct Options {
    /// Scene files; what they are called in reports is their file name.
    pub scenes: Vec<PathBuf>,
    /// Seeds, each with a key, a message and views of its own.
    pub seeds: Vec<u64>,
    /// Side of the pictures that are read, in pixels.
    pub size: u32,
    /// Held-out views of each mark.
    pub views: usize,
    /// The learned codec; without it, it is not among the attacks.
    pub vae: Option<Vae>,
}

/// What a run tells whoever watches it.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// A mark begins: which, of how many, and in words.
    Mark(usize, usize, String),
    /// How its embedding goes.
    Embedding(embed::Progress),
    /// A mark was read under an attack, with this share of bits right.
    Read(String, f64),
    /// A mark was read under so many attacks, in this time.
    ReadAll(usize, Duration),
    /// A mark could not be made, and the run goes on without it: why.
    Failed(String),
    /// Claims were made about a mark: what was looked at, and how many right ones matched, of how many.
    Claimed(String, usize, usize),
    /// A detector looked at marks of this length, with this area under its ROC curve.
    Detected(usize, String, f64),
}

/// Carries out `plan`. `engine` makes the engine for a length and a seed, with the key, and says how long the key took if
/// it was made now; it is called once for each pair that something is left to do for.
///
/// Settings under which an embedding stops giving numbers, or that ask for weights that are not there, leave a gap where many
/// settings are tried (`trade`), and are tried again by the next run.
///
/// # Errors
/// Whatever reading, embedding and writing may fail with. What was recorded before stays, and is not done again.
pub fn run(
    plan: &Plan,
    options: &Options,
    store: &mut Store,
    mut engine: impl FnMut(usize, u64) -> Result<(Engine, Key, Option<f64>)>,
    mut progress: impl FnMut(Progress),
) -> Result<()> {
    let total = plan.wanted.len() * options.scenes.len() * options.seeds.len();
    let mut done = 0;
    let machine = Machine::here();
    let mut judged: BTreeMap<usize, Vec<Marked>> = BTreeMap::new();
    // Seed by seed and length by length, so that what there is after a while is even over scenes.
    for &seed in &options.seeds {
        for wanted in &plan.wanted {
            let mut loaded: Option<(Engine, Key, Option<f64>)> = None;
            for scene in &options.scenes {
                done += 1;
                if loaded.is_none() {
                    loaded = Some(engine(wanted.bits, seed)?);
                }
                let Some((engine, key, key_seconds)) = &mut loaded else {
                    continue;
                };
                let name = name(scene);
                progress(Progress::Mark(
                    done,
                    total,
                    format!("{name}, {} bits, {}, seed {seed}", wanted.bits, wanted.variant),
                ));
                if wanted.timed && wanted.settings.lambda.lpips > 0.0 && !engine.has_lpips() {
                    // Timed without, it would be another variant.
                    progress(Progress::Failed(format!(
                        "{name}, {}: without the weights of LPIPS (`models add`)",
                        wanted.variant
                    )));
                    continue;
                }
                let one = MarkRun {
                    wanted,
                    options,
                    seed,
                    engine,
                    key,
                    key_seconds: key_seconds.take(),
                    machine: &machine,
                };
                let id = match one.carry_out(scene, &name, store, &mut progress) {
                    Ok(id) => id,
                    Err(Error::Engine(guardsplat_engine::Error::NotFinite { .. })) if wanted.timed => {
                        progress(Progress::Failed(format!(
                            "{name}, {}: no longer numbers",
                            wanted.variant
                        )));
                        continue;
                    }
                    Err(e) => return Err(e),
                };
                if wanted.variant == names::STANDARD && plan.judged.contains(&wanted.bits) {
                    judged.entry(wanted.bits).or_default().push(Marked {
                        scene: scene.clone(),
                        name,
                        seed,
                        id,
                    });
                }
            }
        }
    }
    for (bits, marks) in judged {
        let Some(first) = marks.first() else { continue };
        let seed = first.seed;
        let judged = SteganalysisRun { marks: &marks, options };
        let engine = || engine(bits, seed).map(|(engine, ..)| engine);
        judged.carry_out(store, engine, |detector, area| {
            progress(Progress::Detected(bits, detector, area));
        })?;
    }
    Ok(())
}

/// What a scene is called.
fn name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// The message of a seed: none that a decoder was trained on, but for lengths of few messages.
fn message(bits: usize, seed: u64) -> Result<Message> {
    let mut rng = ChaCha20Rng::seed_from_u64(seed ^ 0x6d65_7373_6167_6500);
    Ok(Message::random(bits, &mut rng)?)
}

/// What was read of a mark, for whoever watches.
fn told(record: &Record) -> Option<Progress> {
    match record {
        Record::Reading(reading) => Some(Progress::Read(reading.attack.clone(), reading.accuracy())),
        Record::Claims(claims) => {
            let (matches, of) = (claims.matches(), claims.p_values.len());
            Some(Progress::Claimed(claims.told(), matches, of))
        }
        Record::Mark(_) | Record::Detection(_) => None,
    }
}

/// One mark and its readings.
struct MarkRun<'a> {
    wanted: &'a WantedMark,
    options: &'a Options,
    seed: u64,
    engine: &'a Engine,
    key: &'a Key,
    key_seconds: Option<f64>,
    machine: &'a Machine,
}

impl MarkRun<'_> {
    fn embedding(&self, name: &str, message: &Message) -> Result<Embedding> {
        let settings =
            serde_json::to_vec(&self.wanted.settings).map_err(|e| Error::bad_option("settings", e.to_string()))?;
        Ok(Embedding {
            scene: name.into(),
            bits: self.wanted.bits as u32,
            variant: self.wanted.variant.clone(),
            settings_hash: hex::encode(&Sha256::digest(settings)[..8]),
            seed: self.seed,
            key_seed: self.key.seed.unwrap_or(0),
            message: message.to_string(),
            clip: self.key.clip.name.clone(),
            clip_hash: self.key.clip.hash.clone(),
            engine_version: env!("CARGO_PKG_VERSION").into(),
            size: self.options.size,
        })
    }

    /// Makes the mark and its readings, as far as they are not there, and says which it is.
    fn carry_out(
        &self,
        path_of_scene: &Path,
        name: &str,
        store: &mut Store,
        progress: &mut impl FnMut(Progress),
    ) -> Result<Id> {
        let message = message(self.wanted.bits, self.seed)?;
        let embedding = self.embedding(name, &message)?;
        let id = embedding.id();
        let (size, views) = (self.options.size, self.options.views);
        let claiming = ClaimTrials {
            engine: self.engine,
            message: &message,
            mark: &id,
            size,
            seed: self.seed,
        };
        let trials = TrialRun {
            engine: self.engine,
            message: &message,
            mark: &id,
            wanted: self.wanted,
            claiming: &claiming,
            vae: self.options.vae.as_ref(),
            views,
        };
        let cases = |store: &Store| match self.wanted.claims {
            true => claiming.left(store, views),
            false => Vec::new(),
        };
        if store.has(&id) && trials.left(store).is_empty() && cases(store).is_empty() {
            return Ok(id);
        }
        let scene = Scene::read(path_of_scene)?;
        let first = self.wanted.first_view;
        let cameras = cameras(&scene.gaussians, first..first + views, size, self.seed)?;
        let file = path(store.folder(), &id.to_string(), &scene);
        let marked = if store.has(&id) && file.is_file() {
            Scene::read(&file)?.into_gaussians()
        } else {
            let settings = embed::Settings {
                seed: self.seed,
                ..self.wanted.settings
            };
            let making = Marking {
                engine: self.engine,
                scene: &scene,
                message: &message,
                settings: &settings,
                folder: store.folder(),
                machine: self.machine,
                timed: self.wanted.timed,
            };
            let unmarked = Views::render(self.engine, &scene.gaussians, &cameras)?;
            let key = (self.key_seconds, self.key.accuracy_unseen);
            let (mark, marked) = making.make(embedding, self.wanted.experiment.name(), key, &unmarked, &mut |p| {
                progress(Progress::Embedding(p));
            })?;
            tracing::debug!(seconds = mark.seconds, "marked");
            // A file that was lost is made again; its mark is known.
            if !store.has(&id) {
                store.append(Record::Mark(mark)).map_err(Error::Evaluation)?;
            }
            marked
        };
        let start = Instant::now();
        let plain = Views::render(self.engine, &marked, &cameras)?;
        let left = trials.left(store);
        trials.carry_out(&left, &marked, &plain, |record| {
            told(&record).into_iter().for_each(&mut *progress);
            store.append(record).map_err(Error::Evaluation)?;
            Ok(())
        })?;
        if !left.is_empty() {
            progress(Progress::ReadAll(left.len(), start.elapsed()));
        }
        for case in cases(store) {
            let clean = || Views::render(self.engine, &scene.gaussians, &cameras);
            let records = claiming.carry_out(&case, &plain, clean)?;
            for record in records {
                let record = Record::Claims(record);
                told(&record).into_iter().for_each(&mut *progress);
                store.append(record).map_err(Error::Evaluation)?;
            }
        }
        Ok(id)
    }
}
