//! Readings as CSV in long form: one row a reading, with all that is known of its mark.
use super::atomic_write::write_whole;
use crate::error::{Error, Result};
use crate::report::named::robustness_csv;
use crate::report::selection::{Run, Selection};
use std::collections::BTreeSet;
use std::path::Path;

const COLUMNS: [&str; 36] = [
    "mark",
    "experiment",
    "scene",
    "gaussians",
    "bits",
    "variant",
    "settings_hash",
    "seed",
    "key_seed",
    "message",
    "clip",
    "clip_hash",
    "engine_version",
    "device",
    "mark_size",
    "mark_psnr_db",
    "mark_ssim",
    "mark_lpips",
    "seconds",
    "key_seconds",
    "steps",
    "view_steps",
    "view_steps_to_99",
    "decoder_accuracy",
    "peak_memory_bytes",
    "unmarked_accuracy",
    "difference_picture",
    "reading",
    "attack",
    "size",
    "views",
    "accuracy",
    "worst_view_accuracy",
    "attacked_psnr_db",
    "bits_right",
    "elevation_deg",
];

/// Readings of a selection as CSV with a header.
///
/// Accuracies are shares, 0..=1. What was not measured is empty; `mark_psnr_db` is `inf` where views are identical.
/// `bits_right` and `elevation_deg` have a number for each view, with spaces between. Last come columns
/// `message_right_from_N` of `true`, `false` or nothing, for each number of views N that any message was read from.
///
/// # Errors
/// [`Error::Codec`] if the text cannot be made.
pub fn to_csv(selection: &Selection<'_>) -> Result<String> {
    let failed = |reason: String| Error::Codec { codec: "CSV", reason };
    let runs = selection.all_runs();
    let from: BTreeSet<u32> = runs
        .iter()
        .flat_map(|run| run.reading.message_right_from.keys().copied())
        .collect();
    let mut out = ::csv::Writer::from_writer(Vec::new());
    let header = COLUMNS.map(String::from).into_iter();
    let header = header.chain(from.iter().map(|views| format!("message_right_from_{views}")));
    out.write_record(header).map_err(|e| failed(e.to_string()))?;
    for run in &runs {
        let right = from.iter().map(|views| run.reading.message_right_from.get(views));
        let row = fields(run).into_iter().chain(right.map(maybe));
        out.write_record(row).map_err(|e| failed(e.to_string()))?;
    }
    let bytes = out.into_inner().map_err(|e| failed(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| failed(e.to_string()))
}

/// Writes [`to_csv`] to a file, whole or not at all.
///
/// # Errors
/// Those of [`to_csv`], and [`Error::Io`].
pub fn write_csv(selection: &Selection<'_>, path: &Path) -> Result<()> {
    write_whole(path, to_csv(selection)?.as_bytes())
}

/// Writes the robustness table, [`robustness_csv`], to a file, whole or not at all.
///
/// # Errors
/// [`Error::Codec`] if the text cannot be made, and [`Error::Io`].
pub fn write_robustness_csv(selection: &Selection<'_>, path: &Path) -> Result<()> {
    write_whole(path, robustness_csv(selection)?.as_bytes())
}

/// In the order of [`COLUMNS`].
fn fields(run: &Run<'_>) -> [String; 36] {
    let (mark, reading) = (run.mark, run.reading);
    let embedding = &mark.embedding;
    [
        reading.mark.to_string(),
        mark.experiment.clone(),
        embedding.scene.clone(),
        mark.gaussians.to_string(),
        embedding.bits.to_string(),
        embedding.variant.clone(),
        embedding.settings_hash.clone(),
        embedding.seed.to_string(),
        embedding.key_seed.to_string(),
        embedding.message.clone(),
        embedding.clip.clone(),
        embedding.clip_hash.clone(),
        embedding.engine_version.clone(),
        mark.device.clone(),
        embedding.size.to_string(),
        mark.psnr_db.unwrap_or(f64::INFINITY).to_string(),
        mark.ssim.to_string(),
        maybe(mark.lpips),
        mark.seconds.to_string(),
        maybe(mark.key_seconds),
        mark.steps.to_string(),
        mark.view_steps.to_string(),
        maybe(mark.view_steps_to_99),
        maybe(mark.decoder_accuracy),
        maybe(mark.peak_memory_bytes),
        maybe(mark.unmarked_accuracy),
        maybe(mark.difference_picture.as_ref().map(|path| path.display())),
        reading.id().to_string(),
        reading.attack.clone(),
        reading.size.to_string(),
        reading.views.to_string(),
        reading.accuracy().to_string(),
        reading.worst_accuracy().to_string(),
        maybe(reading.psnr_db),
        list(&reading.bits_right),
        list(reading.elevation_deg.as_deref().unwrap_or_default()),
    ]
}

fn maybe(value: Option<impl ToString>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

fn list<T: ToString>(values: &[T]) -> String {
    let texts: Vec<String> = values.iter().map(T::to_string).collect();
    texts.join(" ")
}
