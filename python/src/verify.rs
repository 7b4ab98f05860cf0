//! Reading scenes and pictures, in files or in memory.
use std::path::PathBuf;
use std::time::Instant;

use guardsplat_engine::extract::find_source;
use guardsplat_engine::picture::Picture;
use guardsplat_engine::scene::BadRows;
use guardsplat_operations::comparison::read_and_compare;
use guardsplat_operations::load;
use guardsplat_operations::suspect::{Suspect, SuspectPicture};
use guardsplat_operations::verification::Views;
use guardsplat_operations::verification_report::{VerificationReport, VerifyReport};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::cameras::Cameras;
use crate::embed::json;
use crate::errors::{bad_option, exception};
use crate::job::run;
use crate::key::Key;

/// What users choose, as `guardsplat._verify` has gathered and checked it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    views: usize,
    size: Option<u32>,
    background: [f32; 3],
    original: Option<PathBuf>,
    cameras: Option<Cameras>,
    kind: Option<String>,
    seed: u64,
    ignore_bad_rows: bool,
    clip: Option<String>,
    device: String,
    memory: Option<u64>,
    logits: bool,
}

/// Reads files, then pictures, each `height, width` and `[height, width, 3]` numbers from 0 to 1; the verdict as JSON.
#[pyfunction]
#[pyo3(signature = (paths, pictures, key, message, options, progress))]
pub fn verify(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    pictures: Vec<(u32, u32, Bound<'_, PyBytes>)>,
    key: &Key,
    message: Option<&str>,
    options: Options,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let start = Instant::now();
    let wrong = |error: guardsplat_engine::Error| exception(py, &error);
    let message = message.map(|text| key.inner.message(text)).transpose().map_err(wrong)?;
    let device = options.device.parse().map_err(wrong)?;
    let kind = options.kind.map(|kind| kind.parse()).transpose();
    let kind = kind.map_err(|reason| bad_option(py, "kind", reason))?;
    let pictures: Vec<SuspectPicture> = pictures
        .into_iter()
        .map(|(height, width, numbers)| {
            SuspectPicture::Pixels(Picture {
                width,
                height,
                pixels: bytemuck::pod_collect_to_vec(numbers.as_bytes()),
            })
        })
        .collect();
    let (inner, path) = (&*key.inner, &key.path);
    run(py, progress, |context| {
        let mut suspect = match paths.is_empty() {
            true => Suspect::default(),
            false => find_source(&paths)?.into(),
        };
        suspect.pictures.extend(pictures);
        let views = Views {
            count: options.views,
            size: options.size,
            background: options.background,
            seed: options.seed,
            cameras: Cameras::of(options.cameras)?,
            kind,
            bad_rows: BadRows::ignored_if(options.ignore_bad_rows),
            with_files: true,
            level: 0,
        };
        let clip = options.clip.as_deref();
        let mut engine = load::engine(path, inner, clip, device, load::Work::Reading, false, options.memory)?;
        engine.stop = context.stop.clone();
        let original = options.original.as_deref();
        let compared = read_and_compare(&engine, &suspect, &views, original, message.as_ref(), |done, total| {
            context.at("reading", done, total);
        })?;
        json(&VerifyReport {
            findings: VerificationReport::of(&engine.message_code, &compared)?,
            seconds: start.elapsed().as_secs_f64(),
            device: &engine.compute.name,
            clip: &inner.clip.name,
            logits: options.logits.then_some(&compared.reading.views[..]),
        })
    })
}
