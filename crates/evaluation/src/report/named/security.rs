//! What detectors without a key see: area under the ROC curve, and the curve.
use super::{Plot, Report};
use crate::error::Result;
use crate::report::names::CONTROL;
use crate::report::plot::{Axes, Line, Point, lines};
use crate::report::record::Detection;
use crate::report::selection::Selection;
use crate::report::table::{Cell, Row, Table};
use crate::statistics::Roc;
use crate::steganalysis::Steganalyzer;

/// Corners of the ROC curve: shares of clean and of marked scores at or above each threshold, from the highest down.
/// Equal scores share a corner, and corners in the middle of a straight step are left out.
fn roc(clean: &[f64], marked: &[f64]) -> Vec<(f64, f64)> {
    let mut scores: Vec<(f64, bool)> = clean.iter().map(|score| (*score, false)).collect();
    scores.extend(marked.iter().map(|score| (*score, true)));
    scores.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (of_clean, of_marked) = (clean.len().max(1) as f64, marked.len().max(1) as f64);
    let (mut false_alarms, mut found) = (0usize, 0usize);
    let mut corners = vec![(0.0, 0.0)];
    for group in scores.chunk_by(|a, b| a.0 == b.0) {
        let hits = group.iter().filter(|(_, is_marked)| *is_marked).count();
        found += hits;
        false_alarms += group.len() - hits;
        let next = (false_alarms as f64 / of_clean, found as f64 / of_marked);
        if let [.., before, last] = corners.as_mut_slice()
            && ((before.0 == last.0 && last.0 == next.0) || (before.1 == last.1 && last.1 == next.1))
        {
            *last = next;
        } else {
            corners.push(next);
        }
    }
    corners
}

/// Share of false alarms at which the share of found marks is told.
const FALSE_ALARMS: f64 = 0.05;
/// Area from which on a positive control fired; not of its interval, which few scenes make wide whatever they show.
const FIRES: f64 = 0.8;

const COLUMNS: [&str; 9] = [
    "detector",
    "bits",
    "scenes",
    "marks",
    "clean pictures",
    "marked pictures",
    "area under the ROC curve",
    "interval over",
    "found at 5 % false alarms (%)",
];

fn row(label: &str, bits: Option<u32>, detection: &Detection) -> Result<Row> {
    let mut scenes = detection.scenes.clone();
    scenes.sort();
    scenes.dedup();
    let roc = Roc::new(&detection.marked, &detection.clean, 0.95)?;
    Ok(Row::new(vec![
        Cell::text(label),
        bits.map_or(Cell::NotMeasured, |bits| Cell::Count(bits.into())),
        Cell::text(scenes.join(", ")),
        Cell::Count(detection.marks.len() as u64),
        Cell::Count(detection.clean.len() as u64),
        Cell::Count(detection.marked.len() as u64),
        Cell::Value {
            value: detection.auc,
            interval: Some(detection.auc_interval),
            decimals: 3,
            identical: 0,
        },
        Cell::text(match detection.clusters {
            Some(scenes) => format!("{scenes} scenes"),
            None => "pictures".into(),
        }),
        Cell::number(100.0 * roc.true_positive_rate_at(FALSE_ALARMS), 1),
    ]))
}

/// A detection with what rows and lines are made of.
struct Told<'a> {
    /// The detector, without the prefix of controls.
    name: &'a str,
    bits: Option<u32>,
    detection: &'a Detection,
}

/// Of each detector and length the detection of most marks, then of most pictures; in the order of [`Steganalyzer::ALL`], others
/// after those. Controls or marks.
fn told<'a>(selection: &Selection<'a>, controls: bool) -> Vec<Told<'a>> {
    let mut told: Vec<Told<'a>> = Vec::new();
    for detection in selection.detections() {
        let name = match detection.detector.strip_prefix(CONTROL) {
            Some(name) if controls => name,
            None if !controls => detection.detector.as_str(),
            _ => continue,
        };
        let first = detection.marks.first().and_then(|mark| selection.records().mark(mark));
        let one = Told {
            name,
            bits: first.map(|mark| mark.embedding.bits),
            detection,
        };
        let size = |told: &Told<'_>| (told.detection.marks.len(), told.detection.clean.len());
        match told
            .iter_mut()
            .find(|other| (other.name, other.bits) == (one.name, one.bits))
        {
            Some(known) if size(known) >= size(&one) => {}
            Some(known) => *known = one,
            None => told.push(one),
        }
    }
    let place = |name: &str| Steganalyzer::ALL.iter().position(|judge| judge.to_string() == name);
    told.sort_by_key(|one| (one.bits, place(one.name).unwrap_or(usize::MAX)));
    told
}

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>) -> Result<()> {
    let marks = told(selection, false);
    let controls = told(selection, true);
    let left_out = selection.records().detections().len() - marks.len() - controls.len();
    if left_out > 0 {
        report
            .notes
            .push(format!("{left_out} detections of other or of fewer marks are left out"));
    }
    section(report, &marks, "", report.title.clone(), AREA)?;
    section(
        report,
        &controls,
        CONTROL,
        "Positive control: replaced bits instead of marks".into(),
        SHOULD,
    )?;
    for control in controls.iter().filter(|one| one.detection.auc < FIRES) {
        report.notes.push(format!(
            "the control of {} did not fire ({:.3}): that it finds no marks in these pictures means nothing",
            control.name, control.detection.auc
        ));
    }
    Ok(())
}

const AREA: &str = "An area of 0.5 is guessing, 1 is certainty; in brackets 95 % intervals (Obuchowski 1997), over scenes \
    where there are several: views of one scene are not independent. Over pictures (DeLong 1988) they are too short. The \
    learned detector judges each scene by what it learned from pairs of all others.";
const SHOULD: &str = "The same unmarked pictures, against themselves with the last bits of half of their samples \
    replaced. A detector that does not fire here has nothing to say above.";

/// A table and its curves.
fn section(report: &mut Report, told: &[Told<'_>], prefix: &str, title: String, note: &str) -> Result<()> {
    let mut rows = told
        .iter()
        .map(|one| row(one.name, one.bits, one.detection))
        .collect::<Result<Vec<_>>>()?;
    for judge in Steganalyzer::ALL.map(|judge| judge.to_string()) {
        if told.iter().any(|one| one.name == judge) {
            continue;
        }
        let why = if judge == Steganalyzer::Learned.to_string() && !told.is_empty() {
            "; it judges scenes by others, so it needs marks of two, and eight pairs of pictures"
        } else {
            ""
        };
        report.missing.push(format!("{prefix}{judge}: not measured{why}"));
        let mut cells = vec![Cell::text(judge), Cell::NotMeasured, Cell::Empty];
        cells.extend([Cell::Count(0), Cell::Count(0), Cell::Count(0)]);
        cells.extend([Cell::NotMeasured, Cell::Empty, Cell::NotMeasured]);
        rows.push(Row::new(cells));
    }
    let curve = |one: &Told<'_>| Line {
        name: format!("{} ({:.3})", one.name, one.detection.auc),
        points: points(roc(&one.detection.clean, &one.detection.marked)),
        dots: false,
    };
    let mut all: Vec<Line> = told.iter().map(curve).collect();
    all.push(Line {
        name: "guessing (0.5)".into(),
        points: points(vec![(0.0, 0.0), (1.0, 1.0)]),
        dots: false,
    });
    let axes = Axes {
        title: "ROC curves",
        x: "share of clean pictures called marked",
        y: "share of marked pictures found",
    };
    report.plots.push(Plot {
        caption: format!("{title}: ROC curves"),
        svg: lines(axes, &all)?,
    });
    report.tables.push(Table {
        title,
        columns: COLUMNS.map(String::from).to_vec(),
        rows,
        notes: vec![note.into()],
    });
    Ok(())
}

fn points(corners: Vec<(f64, f64)>) -> Vec<Point> {
    let point = |(x, y)| Point { x, y, interval: None };
    corners.into_iter().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hand_computed_curves() {
        let corners = roc(&[0.1, 0.4], &[0.3, 0.9]);
        assert_eq!(corners, [(0.0, 0.0), (0.0, 0.5), (0.5, 0.5), (0.5, 1.0), (1.0, 1.0)]);
        // All the same: nothing but the diagonal.
        assert_eq!(roc(&[1.0, 1.0], &[1.0]), [(0.0, 0.0), (1.0, 1.0)]);
        // Told apart: straight up, then right, without the corners on the way.
        assert_eq!(roc(&[1.0, 2.0], &[3.0, 4.0, 5.0]), [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0)]);
    }
}
