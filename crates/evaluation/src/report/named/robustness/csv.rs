//! The robustness table as CSV: a row for each attack, over all scenes and for each.
use super::measured::{Case, cases};
use super::percent;
use crate::error::{Error, Result};
use crate::report::record::Mark;
use crate::report::selection::Selection;
use crate::report::summary::{Estimate, Summary};
use crate::report::targets::{Column, PSNR_DB};

const COLUMNS: [&str; 26] = [
    "variant",
    "bits",
    "line",
    "attack",
    "scene",
    "marks",
    "accuracy_percent",
    "accuracy_percent_95_low",
    "accuracy_percent_95_high",
    "accuracy_percent_asked",
    "pictures_together",
    "together",
    "marks_together",
    "marks_right_together",
    "marks_right_together_percent",
    "marks_right_together_percent_low",
    "marks_right_together_percent_high",
    "marks_right_together_percent_asked",
    "attacked_against_unattacked_psnr_db",
    "mark_psnr_db",
    "mark_psnr_db_95_low",
    "mark_psnr_db_95_high",
    "mark_psnr_db_asked",
    "embedding_seconds",
    "embedding_seconds_95_low",
    "embedding_seconds_95_high",
];

/// The table as CSV with a header; what was not measured is left out, or empty. `scene` is `all` where it is over all.
///
/// # Errors
/// [`Error::Codec`] if the text cannot be made.
pub fn to_csv(selection: &Selection<'_>) -> Result<String> {
    let failed = |reason: String| Error::Codec { codec: "CSV", reason };
    let mut out = ::csv::Writer::from_writer(Vec::new());
    out.write_record(COLUMNS).map_err(|e| failed(e.to_string()))?;
    for column in Column::ALL {
        let marks = selection.marks_of(column.bits(), column.variant());
        let mut scenes: Vec<&str> = marks.iter().map(|mark| mark.embedding.scene.as_str()).collect();
        scenes.dedup();
        for case in cases(column, selection) {
            for scene in std::iter::once(None).chain(scenes.iter().copied().map(Some)) {
                if let Some(row) = fields(&case, selection, &marks, scene) {
                    out.write_record(row).map_err(|e| failed(e.to_string()))?;
                }
            }
        }
    }
    let bytes = out.into_inner().map_err(|e| failed(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| failed(e.to_string()))
}

/// In the order of [`COLUMNS`]; `None` for what was not measured.
fn fields(case: &Case<'_>, selection: &Selection<'_>, marks: &[&Mark], scene: Option<&str>) -> Option<[String; 26]> {
    let measured = case.measured(selection, scene);
    if measured.summary.runs == 0 && measured.together.is_none() {
        return None;
    }
    let of_scene = |mark: &&&Mark| scene.is_none_or(|scene| mark.embedding.scene == scene);
    let of_marks = Summary::of_marks(&marks.iter().filter(of_scene).copied().collect::<Vec<_>>());
    let column = case.column;
    let [accuracy, low, high] = estimate(measured.summary.accuracy, 2);
    let [psnr, psnr_low, psnr_high] = estimate(of_marks.psnr.differing, 2);
    let [seconds, seconds_low, seconds_high] = estimate(of_marks.seconds, 1);
    let together = measured.together.as_ref();
    let end = |place: usize| maybe(together.map(|share| 100.0 * share.interval[place]), 1);
    Some([
        column.variant().into(),
        column.bits().to_string(),
        case.line.into(),
        case.attack.into(),
        scene.unwrap_or("all").into(),
        measured.summary.runs.to_string(),
        accuracy,
        low,
        high,
        maybe(case.target.and_then(|target| target.accuracy), 1),
        column.pictures().to_string(),
        if column.claims() { "match" } else { "whole message" }.into(),
        together.map_or_else(String::new, |share| share.of.to_string()),
        together.map_or_else(String::new, |share| share.right.to_string()),
        maybe(together.map(percent), 1),
        end(0),
        end(1),
        maybe(case.target.and_then(|target| target.matches), 1),
        maybe(measured.summary.attacked_psnr.map(|mean| mean.mean), 2),
        psnr,
        psnr_low,
        psnr_high,
        maybe(Some(PSNR_DB), 1),
        seconds,
        seconds_low,
        seconds_high,
    ])
}

fn estimate(estimate: Option<Estimate>, decimals: usize) -> [String; 3] {
    let interval = estimate.and_then(|mean| mean.interval);
    [
        maybe(estimate.map(|mean| mean.mean), decimals),
        maybe(interval.map(|ends| ends[0]), decimals),
        maybe(interval.map(|ends| ends[1]), decimals),
    ]
}

fn maybe(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(String::new, |value| format!("{value:.decimals$}"))
}
