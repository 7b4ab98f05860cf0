//! Reports show what was asked for, whether it was measured or not.
use super::*;
use crate::report::names::{DC, NONE, STANDARD};
use crate::report::record::Record;
use crate::report::store::Records;
use crate::report::testing::{detection, mark, reading, records};

fn some() -> Records {
    let marks = [
        mark("lego", 16, STANDARD, 1),
        mark("lego", 32, STANDARD, 1),
        mark("lego", 32, DC, 1),
        mark("lego", 32, "lambda-msg:0.3", 1),
        mark("lego", 32, "lambda-msg:0.05", 1),
    ];
    let mut all: Vec<Record> = marks.iter().cloned().map(Record::Mark).collect();
    all.extend(marks.iter().map(|mark| Record::Reading(reading(mark, NONE, &[16, 12]))));
    for attack in [
        "jpeg:10",
        "squeeze:3",
        "prune-random:0.1",
        "sh-noise:0.01",
        "format:spz",
        "sh-degree:0",
    ] {
        all.push(Record::Reading(reading(&marks[0], attack, &[15])));
        all.push(Record::Reading(reading(&marks[1], attack, &[31])));
    }
    all.push(Record::Detection(detection(&marks[..1])));
    records(all)
}

/// First cells and accuracies of a report's rows.
fn rows(report: &Report) -> Vec<(String, String)> {
    let rows = report.tables.iter().flat_map(|table| &table.rows);
    rows.map(|row| (row.cells[0].to_string(), row.cells[2].to_string()))
        .collect()
}

fn made(kind: Experiment, records: &Records) -> Report {
    report(kind, &Selection::newest(records).unwrap(), &Options::default()).unwrap()
}

fn row(label: &str, accuracy: &str) -> (String, String) {
    (label.into(), accuracy.into())
}

#[test]
fn capacity_has_all_lengths_of_the_paper() {
    let records = some();
    let report = made(Experiment::Capacity, &records);
    let expected = [
        row("16", "87.50"),
        row("32", "43.75"),
        row("48", "not measured"),
        row("64", "not measured"),
        row("72", "not measured"),
    ];
    assert_eq!(rows(&report), expected);
    assert!(
        report
            .missing
            .contains(&"72 bits, standard, none: not measured".to_string())
    );
    assert_eq!(report.plots.len(), 3);
}

#[test]
fn ablations_and_families() {
    let records = some();
    let trained = rows(&made(Experiment::Trained, &records));
    assert_eq!(trained[0], row("all attributes", "not measured"));
    assert_eq!(trained[1], row("DC only", "43.75"));
    let pruning = rows(&made(Experiment::Pruning, &records));
    assert_eq!(pruning.len(), 4);
    assert_eq!(pruning[3], row("prune-random:0.1", "96.88"));
    let perturbed = rows(&made(Experiment::Perturbations, &records));
    assert_eq!(
        perturbed[1..],
        [row("sh-noise:0.01", "96.88"), row("occlusion:", "not measured")]
    );
    let formats = rows(&made(Experiment::Formats, &records));
    assert_eq!(formats[1], row("format:ply", "not measured"));
    assert_eq!(formats[3], row("format:spz", "96.88"));
    assert_eq!(formats[6..], [row("sh-degree:0", "96.88")]);
    let longer = rows(&made(Experiment::Longer, &records));
    assert_eq!(longer, [row("128", "not measured")]);
}

#[test]
fn weights_are_in_the_order_of_numbers() {
    let records = some();
    let sensitivity = made(Experiment::Sensitivity, &records);
    assert_eq!(sensitivity.tables.len(), 2);
    let labels: Vec<String> = sensitivity.tables[1]
        .rows
        .iter()
        .map(|row| row.cells[0].to_string())
        .collect();
    assert_eq!(labels, ["as they are", "lambda-msg:0.05", "lambda-msg:0.3"]);
    assert!(
        sensitivity
            .missing
            .contains(&"32 bits, lambda-recon:, none: not measured".to_string())
    );
}

#[test]
fn security_and_elevation() {
    let records = some();
    let security = made(Experiment::Security, &records);
    let cells: Vec<String> = security.tables[0].rows[0]
        .cells
        .iter()
        .map(ToString::to_string)
        .collect();
    let expected = [
        "chi-square",
        "16",
        "lego",
        "1",
        "2",
        "2",
        "0.750 (0.200 to 0.980)",
        "pictures",
        "50.0",
    ];
    assert_eq!(cells, expected);
    // Five other detectors, and six that have no control.
    assert_eq!(security.missing.len(), 11);
    assert!(
        security
            .missing
            .iter()
            .any(|m| m.starts_with("learned: not measured; it judges"))
    );
    let elevation = made(Experiment::Elevation, &records);
    // Bins, and the marks of a ring.
    assert_eq!(elevation.missing.len(), 13);
    assert_eq!(elevation.tables[0].rows[0].cells[0].to_string(), "-90° to -75°");
}

#[test]
fn security_tells_the_largest_detection_and_controls_that_do_not_fire() {
    let marks = [mark("lego", 16, STANDARD, 1), mark("ship", 16, STANDARD, 1)];
    let mut all: Vec<Record> = marks.iter().cloned().map(Record::Mark).collect();
    let mut both = detection(&marks);
    both.clusters = Some(2);
    let mut control = both.clone();
    control.detector = "control:chi-square".into();
    all.extend([detection(&marks[..1]), both, control].map(Record::Detection));
    let records = records(all);
    let report = made(Experiment::Security, &records);
    let firsts: Vec<[String; 2]> = report
        .tables
        .iter()
        .map(|table| [2, 7].map(|column| table.rows[0].cells[column].to_string()))
        .collect();
    assert_eq!(firsts, [["lego, ship", "2 scenes"]; 2]);
    assert_eq!(report.missing.len(), 10);
    let notes = report.notes.join("\n");
    assert!(
        notes.contains("control of chi-square did not fire") && notes.contains("1 detections of other"),
        "{notes}"
    );
    assert_eq!(report.plots.len(), 2);
}

#[test]
fn every_report_can_be_made_of_one_mark() {
    let records = records([Record::Mark(mark("lego", 8, "unknown", 1))]);
    let selection = Selection::newest(&records).unwrap();
    let reports = all(&selection, &Options::default()).unwrap();
    assert_eq!(reports.len(), Experiment::ALL.len());
    for report in &reports {
        assert!(!report.missing.is_empty(), "{}", report.name);
        assert!(
            report.tables.iter().all(|table| !table.rows.is_empty()),
            "{}",
            report.name
        );
        assert_eq!(report.name.parse::<Experiment>().unwrap().title(), report.title);
    }
    assert!("capacities".parse::<Experiment>().is_err());
}
