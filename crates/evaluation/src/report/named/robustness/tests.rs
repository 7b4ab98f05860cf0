//! Lines are told whether they were measured or not, and marks are what is counted.
use super::*;
use crate::report::named::{Experiment, report};
use crate::report::names::{NONE, ROBUST};
use crate::report::record::{Claims, Mark, Record};
use crate::report::store::Records;
use crate::report::targets::SCREENSHOT;
use crate::report::testing::{claims, mark, reading, records};

/// One claim about the first pictures of a mark.
fn claim(mark: &Mark, attack: &str, pictures: u32, p: f64) -> Record {
    Record::Claims(Claims {
        views: pictures,
        pool: pictures,
        p_values: vec![p],
        payloads: 0,
        wrong: 0,
        wrong_at_most: [0; 6],
        wrong_as_trials: None,
        ..claims(mark, attack, true)
    })
}

fn measured() -> Records {
    let [one, two] = ["lego", "ship"].map(|scene| mark(scene, 32, STANDARD, 1));
    let robust = mark("lego", 16, ROBUST, 1);
    let mut whole = reading(&robust, NONE, &[16; 5]);
    whole.message_right_from.insert(5, true);
    let mut all = vec![
        Record::Mark(one.clone()),
        Record::Mark(two.clone()),
        Record::Mark(robust.clone()),
        Record::Reading(reading(&one, SCREENSHOT, &[32, 32])),
        Record::Reading(reading(&two, SCREENSHOT, &[24, 32])),
        claim(&one, SCREENSHOT, 5, 1e-8),
        claim(&two, SCREENSHOT, 5, 1e-3),
        // Claims of another number of views are told elsewhere.
        Record::Claims(claims(&two, SCREENSHOT, true)),
        Record::Reading(reading(&one, "squeeze:3", &[16])),
        Record::Reading(reading(&one, "sh-noise:0.01", &[16])),
        Record::Reading(whole),
    ];
    all.push(Record::Reading(reading(&robust, "jpeg:10", &[8; 5])));
    records(all)
}

fn made(records: &Records) -> Report {
    report(
        Experiment::Robustness,
        &Selection::newest(records).unwrap(),
        &Options::default(),
    )
    .unwrap()
}

/// The cells of the row of an attack.
fn row(table: &Table, attack: &str) -> Vec<String> {
    let found = table.rows.iter().find(|row| row.cells[1].to_string() == attack);
    found.unwrap().cells.iter().map(ToString::to_string).collect()
}

#[test]
fn lines_stand_beside_what_is_asked() {
    let report = made(&measured());
    let titles: Vec<&str> = report.tables.iter().map(|table| table.title.as_str()).collect();
    assert_eq!(
        titles,
        [
            "The marks",
            "bits of a picture, standard at 32 bits",
            "bits of a picture, robust at 16 bits"
        ]
    );
    let marks: Vec<String> = report.tables[0]
        .rows
        .iter()
        .map(|row| row.cells[1].to_string())
        .collect();
    assert_eq!(marks, ["2", "1", "0"]);
    let standard = &report.tables[1];
    let screenshot = row(standard, SCREENSHOT);
    assert_eq!(screenshot[0], "screenshot");
    // 100 and 87.5 %; Student's t of one degree makes the interval all there is below 100.
    assert!(screenshot[3].starts_with("93.8 ("), "{screenshot:?}");
    assert_eq!(screenshot[4], "bar 92.0 ✓");
    assert!(screenshot[5].starts_with("1 of 2 ("), "{screenshot:?}");
    assert_eq!(screenshot[6], "bar 95.0 (missed by 45.0)");
    assert_eq!(row(standard, "jpeg:30")[3], "not measured");
    // What nothing is asked of comes last; other reports tell what is done to scenes.
    assert_eq!(standard.rows.last().unwrap().cells[0].to_string(), "squeeze:3");
    let robust = &report.tables[2];
    assert!(row(robust, NONE)[5].starts_with("1 of 1 ("));
    // No views were read together, and the paper's figure stands before what is asked.
    assert_eq!(
        row(robust, "jpeg:10")[4..6],
        ["94.7, bar 95.0 (missed by 45.0)", "not measured"]
    );
    assert_eq!(report.plots.len(), 2);
}

#[test]
fn what_is_missing_is_told() {
    let missing = made(&measured()).missing;
    for told in [
        "32 bits, standard, jpeg:30: not measured (2 marks without this reading)",
        "32 bits, standard, squeeze:3: 1 of 2 marks not measured",
        "16 bits, robust, vae:3: not measured: no weights",
        "16 bits, robust, jpeg:10: 5 pictures together not measured",
        "64 bits, standard: not measured",
    ] {
        assert!(missing.iter().any(|line| line == told), "{told}: {missing:?}");
    }
}

#[test]
fn rows_as_csv_are_over_all_scenes_and_of_each() {
    let records = measured();
    let text = to_csv(&Selection::newest(&records).unwrap()).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 26), "{text}");
    let of = |attack: &str, scene: &str| rows.iter().find(|row| (row[3], row[4]) == (attack, scene)).unwrap();
    let all = of(SCREENSHOT, "all");
    assert_eq!((all[5], all[6], all[9]), ("2", "93.75", "92.0"));
    assert_eq!(all[11..15], ["match", "2", "1", "50.0"]);
    assert_eq!(of(SCREENSHOT, "ship")[12..15], ["1", "0", "0.0"]);
    assert_eq!(of(NONE, "lego")[11], "whole message");
    assert_eq!(all[19], "40.00");
    assert!(!text.contains("jpeg:30"));
}
