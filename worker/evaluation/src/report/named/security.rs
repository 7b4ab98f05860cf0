//! What detectors without a key see: area under the ROC curve, and the curve.
use super::{Plot, Report};
use crate::error::Result;
use crate::report::plot::{Axes, Line, Point, lines};
use crate::report::record::Detection;
use crate::report::selection::Selection;
use crate::report::table::{Cell, Row, Table};

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

fn row(detection: &Detection) -> Row {
    let mut scenes = detection.scenes.clone();
    scenes.sort();
    scenes.dedup();
    Row::new(vec![
        Cell::text(&detection.detector),
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
    ])
}

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>) -> Result<()> {
    let detections = selection.detections();
    let mut rows: Vec<Row> = detections.iter().copied().map(row).collect();
    if rows.is_empty() {
        report.missing.push("detectors: not measured".into());
        let mut cells = vec![Cell::text("any detector"), Cell::NotMeasured];
        cells.extend([Cell::Count(0), Cell::Count(0), Cell::Count(0), Cell::NotMeasured]);
        rows.push(Row::new(cells));
    }
    let left_out = selection.records().detections().len() - detections.len();
    if left_out > 0 {
        report
            .notes
            .push(format!("{left_out} detections of other marks are left out"));
    }
    let columns = [
        "detector",
        "scenes",
        "marks",
        "clean pictures",
        "marked pictures",
        "area under the ROC curve",
    ];
    report.tables.push(Table {
        title: report.title.clone(),
        columns: columns.map(String::from).to_vec(),
        rows,
        notes: vec!["An area of 0.5 is guessing; in brackets 95 % intervals.".into()],
    });
    let curve = |detection: &&Detection| Line {
        name: format!("{} ({:.3})", detection.detector, detection.auc),
        points: points(roc(&detection.clean, &detection.marked)),
        dots: false,
    };
    let mut all: Vec<Line> = detections.iter().map(curve).collect();
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
        caption: "ROC curves of detectors without a key".into(),
        svg: lines(axes, &all)?,
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
