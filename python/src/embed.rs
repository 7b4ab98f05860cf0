//! Marking scenes.
use std::path::PathBuf;
use std::time::Instant;

use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::embed::{Job, Preset, Progress, Settings, embed_with_files};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::{Key as EngineKey, Message};
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::view::Camera;
use guardsplat_engine::{Error, Result};
use guardsplat_operations::embed_report::EmbedReport;
use guardsplat_operations::embed_settings::Choices;
use guardsplat_operations::load;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::cameras::Cameras;
use crate::errors::{bad_option, exception};
use crate::gaussians::{Arrays, array};
use crate::job::{Context, Event, run};
use crate::key::Key;

/// What users choose, as `guardsplat._embed` has gathered it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    preset: String,
    seed: u64,
    device: String,
    cameras: Option<Cameras>,
    kind: Option<String>,
    size: Option<u32>,
    robust_to: Option<String>,
    learn: String,
    ring: Option<f32>,
    settings: Option<String>,
    clip: Option<String>,
    force: bool,
    ignore_bad_rows: bool,
    memory: Option<u64>,
}

/// The same, as the engine has it.
struct Chosen {
    preset: Preset,
    settings: Settings,
    device: DeviceChoice,
    cameras: Vec<Camera>,
    clip: Option<String>,
    force: bool,
    bad_rows: BadRows,
    memory: Option<u64>,
}

impl Options {
    fn chosen(self, py: Python<'_>) -> PyResult<Chosen> {
        let wrong = |error: Error| exception(py, &error);
        let kind = self.kind.map(|kind| kind.parse()).transpose();
        let robust_to = self.robust_to.map(|list| list.parse()).transpose();
        let preset = self.preset.parse().map_err(wrong)?;
        let choices = Choices {
            preset,
            seed: self.seed,
            size: self.size,
            robust_to: robust_to
                .map_err(|error: guardsplat_distortion::Error| bad_option(py, "robust_to", error.to_string()))?,
            learn: self.learn.parse().map_err(wrong)?,
            ring: self.ring,
            kind: kind.map_err(|reason| bad_option(py, "kind", reason))?,
            overrides: self.settings,
        };
        Ok(Chosen {
            preset,
            settings: choices.settings().map_err(wrong)?,
            device: self.device.parse().map_err(wrong)?,
            cameras: py.detach(|| Cameras::of(self.cameras)).map_err(wrong)?,
            clip: self.clip,
            force: self.force,
            bad_rows: BadRows::ignored_if(self.ignore_bad_rows),
            memory: self.memory,
        })
    }
}

impl Chosen {
    /// The engine for the key, which heeds the job's end.
    fn engine(&self, path: &std::path::Path, key: &EngineKey, context: &Context) -> Result<Engine> {
        let mut engine = load::engine(
            path,
            key,
            self.clip.as_deref(),
            self.device,
            load::Work::Marking,
            true,
            self.memory,
        )?;
        engine.stop = context.stop.clone();
        Ok(engine)
    }
}

/// Marks a scene file; the report as JSON.
#[pyfunction]
#[pyo3(signature = (input, output, key, message, options, progress))]
pub fn embed(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    key: &Key,
    message: &str,
    options: Options,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let start = Instant::now();
    let chosen = options.chosen(py)?;
    let message = message_of(py, key, message)?;
    let (inner, path) = (&*key.inner, &key.path);
    run(py, progress, |context| {
        let engine = chosen.engine(path, inner, context)?;
        let job = Job {
            input: &input,
            output: &output,
            message: &message,
            settings: &chosen.settings,
            cameras: &chosen.cameras,
            force: chosen.force,
            bad_rows: chosen.bad_rows,
        };
        let outcome = embed_with_files(&engine, &job, &mut |progress| tell(context, progress))?;
        json(&EmbedReport::of(
            &outcome,
            &engine,
            inner,
            chosen.preset,
            start.elapsed(),
        ))
    })
}

/// Marks Gaussians in memory; the report as JSON and their colours, with the room that they came with.
#[pyfunction]
#[pyo3(signature = (arrays, key, message, options, progress))]
pub fn embed_gaussians<'py>(
    py: Python<'py>,
    arrays: Arrays<'py>,
    key: &Key,
    message: &str,
    options: Options,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(String, Bound<'py, PyByteArray>)> {
    let start = Instant::now();
    let chosen = options.chosen(py)?;
    let message = message_of(py, key, message)?;
    let gaussians = arrays.gaussians();
    let (inner, path) = (&*key.inner, &key.path);
    let (report, colours) = run(py, progress, |context| {
        let engine = chosen.engine(path, inner, context)?;
        let (colours, mut outcome) = guardsplat_engine::embed::embed_gaussians(
            &engine,
            gaussians,
            &message,
            &chosen.settings,
            &chosen.cameras,
            &mut |progress| tell(context, progress),
        )?;
        outcome.written |= chosen.force;
        let report = EmbedReport::of(&outcome, &engine, inner, chosen.preset, start.elapsed());
        Ok((json(&report)?, colours))
    })?;
    Ok((report, array(py, &arrays.with_all_bands(&colours))))
}

fn message_of(py: Python<'_>, key: &Key, text: &str) -> PyResult<Message> {
    key.inner.message(text).map_err(|error| exception(py, &error))
}

/// Tells what watchers of a server's job are told.
fn tell(context: &Context, progress: Progress) {
    match progress {
        Progress::Step(step) => context.tell(Event {
            stage: "optimising",
            done: step.step,
            total: step.total,
            bit_accuracy: Some(step.bit_accuracy),
            psnr_db: Some(step.psnr_db).filter(|db| db.is_finite()),
        }),
        Progress::Verifying { done, total } => context.at("reading", done, total),
        Progress::Admitted(_)
        | Progress::Covered { .. }
        | Progress::Check(_)
        | Progress::Stopped { .. }
        | Progress::Timed(_)
        | Progress::Writing => {}
    }
}

/// A report as JSON.
pub fn json(report: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string(report).map_err(|error| Error::BadOption {
        field: "report",
        reason: error.to_string(),
    })
}
