//! The front is what the definition says, and notes tell when seconds cannot be compared.
use super::table::VIEWS;
use super::*;
use crate::report::named::{Experiment, Options, report};
use crate::report::names::{NONE, SHARED};
use crate::report::record::{Mark, Record};
use crate::report::store::Records;
use crate::report::testing::{mark, reading, records, timing};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const RUN: &str = "2026-01-01T00:00:00Z";

/// A mark of a variant with these seconds and PSNR, and what was read of it: whether the message was right from 1, 5
/// and 10 views, and 16 or 12 bits of 16.
fn timed(variant: &str, scene: &str, figures: [f64; 2], right: [bool; 3]) -> (Mark, Vec<Record>) {
    let mut mark = mark(scene, 16, &format!("trade:cpu:{variant}"), 1);
    mark.seconds = figures[0];
    mark.psnr_db = Some(figures[1]).filter(|psnr| psnr.is_finite());
    mark.timing = Some(timing(RUN));
    let mut reading = reading(&mark, NONE, &[if right[0] { 16 } else { 12 }; 10]);
    reading.message_right_from = VIEWS.into_iter().zip(right).collect();
    let records = vec![Record::Mark(mark.clone()), Record::Reading(reading)];
    (mark, records)
}

fn made(records: &Records) -> Report {
    report(
        Experiment::Trade,
        &Selection::newest(records).unwrap(),
        &Options::default(),
    )
    .unwrap()
}

/// First and last cells of rows.
fn fronts(report: &Report) -> Vec<(String, String)> {
    let rows = report.tables.iter().flat_map(|table| &table.rows);
    rows.map(|row| (row.cells[0].to_string(), row.cells[12].to_string()))
        .collect()
}

fn pair(name: &str, front: &str) -> (String, String) {
    (name.into(), front.into())
}

#[test]
fn a_hand_computed_table() {
    let all = [
        timed("draft", "lego", [10.0, 34.0], [false, true, true]),
        timed("standard", "lego", [40.0, 36.0], [true, true, true]),
        timed("steps-100", "lego", [12.0, 33.0], [false, true, true]), // slower and worse than draft
        timed("nothing", "lego", [5.0, f64::INFINITY], [false, false, false]),
        timed("paper", "lego", [400.0, 39.0], [true, false, true]), // nothing has both more success and more PSNR
    ];
    let records = records(all.into_iter().flat_map(|(_, records)| records));
    let report = made(&records);
    let expected = [
        pair("nothing", "yes"),
        pair("draft", "yes"),
        pair("steps-100", "–"),
        pair("standard", "yes"),
        pair("paper", "–"),
    ];
    assert_eq!(fronts(&report), expected);
    let table = &report.tables[0];
    assert!(
        table.title.contains("16 bits, cpu, a processor, 4 threads on 4 cores"),
        "{}",
        table.title
    );
    assert_eq!(table.columns[3], "times standard");
    let cells: Vec<String> = table.rows[1].cells.iter().map(ToString::to_string).collect();
    assert_eq!(cells[2..7], ["10.0", "0.25", "100.0", "1300", "75.00"]);
    assert_eq!(
        (cells[7].as_str(), cells[9].as_str()),
        ("not measured", "1 of 1 (21 to 100 %)")
    );
    let notes = table.notes.join("\n");
    assert!(
        notes.contains("whole messages from 5 views") && notes.contains("was quiet before"),
        "{notes}"
    );
    assert!(!notes.contains("runs of the program"));
    assert_eq!(report.plots.len(), 1);
    for name in ["draft", "standard", "paper"] {
        assert!(report.plots[0].svg.contains(name), "{name}");
    }
    assert!(report.missing.is_empty());
}

#[test]
fn other_runs_devices_and_lacking_scenes_are_told() {
    let mut all = vec![
        timed("standard", "lego", [40.0, 36.0], [true; 3]),
        timed("standard", "ship", [80.0, 36.0], [true; 3]),
        timed("draft", "lego", [1.0, 38.0], [true; 3]),
        timed("half-weights", "lego", [20.0, 36.0], [true; 3]),
        timed("half-weights", "ship", [40.0, 36.0], [true; 3]),
    ];
    let change = |one: &mut (Mark, Vec<Record>), change: &dyn Fn(&mut Mark)| {
        if let Record::Mark(mark) = &mut one.1[0] {
            change(mark);
        }
    };
    change(&mut all[3], &|mark| {
        mark.timing.as_mut().unwrap().run = "2026-01-02T00:00:00Z".into()
    });
    change(&mut all[4], &|mark| {
        mark.timing.as_mut().unwrap().load_before = Some(2.0)
    });
    let same_place = records(all.iter().flat_map(|(_, records)| records.clone()));
    let report = made(&same_place);
    let expected = [
        pair("draft", "not compared"),
        pair("half-weights", "yes"),
        pair("standard", "–"),
    ];
    assert_eq!(fronts(&report), expected);
    // Half of the time in both scenes, which varies by nothing.
    assert_eq!(report.tables[0].rows[1].cells[3].to_string(), "0.50 (0.50 to 0.50)");
    let notes = report.tables[0].notes.join("\n");
    for needle in [
        "2 runs of the program",
        "was not quiet",
        "load was 2.0, with 4 cores",
        "1 variants lack",
    ] {
        assert!(notes.contains(needle), "{needle}: {notes}");
    }
    // On another device, each has a front of its own.
    change(&mut all[2], &|mark| mark.device = "wgpu: a card".into());
    let two_places = records(all.into_iter().flat_map(|(_, records)| records));
    let report = made(&two_places);
    assert_eq!((report.tables.len(), report.plots.len()), (2, 2));
    assert_eq!(fronts(&report)[2], pair("draft", "yes"));
}

#[test]
fn the_front_is_what_the_definition_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for round in 0..20 {
        let all: Vec<(f64, bool, f64)> = (0..12)
            .map(|_| {
                (
                    rng.random_range(1..5).into(),
                    rng.random(),
                    rng.random_range(30..34).into(),
                )
            })
            .collect();
        let each = all.iter().enumerate();
        let marks = each.map(|(k, (seconds, right, psnr))| {
            timed(&format!("{k:02}"), "lego", [*seconds, *psnr], [false, *right, true]).1
        });
        let records = records(marks.flatten());
        let beaten = |b: &(f64, bool, f64)| {
            let as_good = |a: &(f64, bool, f64)| a.0 <= b.0 && a.1 >= b.1 && a.2 >= b.2;
            all.iter().any(|a| as_good(a) && a != b)
        };
        for (name, front) in fronts(&made(&records)) {
            let place: usize = name.parse().unwrap();
            assert_eq!(front == "yes", !beaten(&all[place]), "round {round}, {name}");
        }
    }
}

#[test]
fn attacks_and_other_experiments_are_left_out() {
    let (timed_mark, mut all) = timed("draft", "lego", [10.0, 34.0], [true; 3]);
    all.push(Record::Reading(reading(&timed_mark, "jpeg:10", &[3])));
    let standard = mark("lego", 16, "standard", 1);
    all.push(Record::Mark(standard.clone()));
    all.push(Record::Reading(reading(&standard, NONE, &[16])));
    let records = records(all);
    assert_eq!(fronts(&made(&records)), [pair("draft", "yes")]);
}

#[test]
fn shared_pictures_decide_where_all_were_read_and_lengths_are_shown_together() {
    let mut all = Vec::new();
    for (variant, seconds, right) in [("draft", 10.0, 12), ("standard", 40.0, 14), ("steps-100", 45.0, 13)] {
        let (one, records) = timed(variant, "lego", [seconds, 38.0], [true; 3]);
        all.extend(records);
        // Of one of the five all bits are read, of the others so many.
        all.extend(SHARED.iter().enumerate().map(|(place, attack)| {
            let right = if place == 0 { 16 } else { right };
            Record::Reading(reading(&one, attack, &[right]))
        }));
    }
    let report = made(&records(all.clone()));
    let expected = [pair("draft", "yes"), pair("standard", "yes"), pair("steps-100", "–")];
    assert_eq!(fronts(&report), expected);
    assert_eq!(report.tables[0].rows[0].cells[7].to_string(), "80.00");
    assert_eq!(report.plots.len(), 1);
    assert!(report.plots[0].svg.contains("bits of shared pictures"));
    let notes = report.tables[0].notes.join("\n");
    assert!(notes.contains("the mean over jpeg-turbo:50..95"), "{notes}");

    // A longer message in the same time is better, so both lengths of it are on the front of all.
    let mut long = timed("standard", "lego", [40.0, 38.0], [true; 3]).0;
    (long.embedding.bits, long.embedding.message) = (32, "c0ffee42".into());
    all.push(Record::Mark(long.clone()));
    all.push(Record::Reading(reading(&long, NONE, &[32])));
    all.extend(
        SHARED
            .iter()
            .map(|attack| Record::Reading(reading(&long, attack, &[24]))),
    );
    let report = made(&records(all));
    assert_eq!((report.tables.len(), report.plots.len()), (2, 3));
    let together = &report.plots[0].svg;
    for label in ["draft 16", "standard 16", "standard 32"] {
        assert!(together.contains(label), "{label}");
    }
    assert!(!together.contains("steps-100"));
    let rings = |svg: &str| svg.matches(" r=\"8\"").count();
    assert_eq!((rings(together), rings(&report.plots[1].svg)), (3, 2));
}
