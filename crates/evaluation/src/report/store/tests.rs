//! Stores resume, refuse a second writer, and survive crashes but nothing else.
use super::*;
use crate::report::testing::{detection, mark, reading};

fn text(folder: &Path) -> String {
    std::fs::read_to_string(folder.join(FILE)).unwrap()
}

fn filled(folder: &Path) -> (Id, Id) {
    let mut store = Store::open(folder).unwrap();
    let mark = mark("lego", 16, "standard", 1);
    let first = store.append(Record::Mark(mark.clone())).unwrap();
    let mut reading = reading(&mark, "jpeg:10", &[16, 3]);
    reading.psnr_db = Some(0.1 + 0.2);
    reading.elevation_deg = Some(vec![0.1, -12.5]);
    let second = store.append(Record::Reading(reading)).unwrap();
    store.append(Record::Detection(detection(&[mark]))).unwrap();
    (first, second)
}

#[test]
fn a_resumed_run_knows_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = filled(folder.path());
    let mut store = Store::open(folder.path()).unwrap();
    assert!(store.has(&first) && store.has(&second));
    let asked = mark("lego", 16, "standard", 2);
    assert!(!store.has(&asked.embedding.id()));
    let other = store.append(Record::Mark(asked)).unwrap();
    drop(store);
    let records = Records::read(folder.path()).unwrap();
    assert!(records.has(&other));
    assert_eq!(records.marks().len(), 2);
    assert_eq!(records.marks()[0].1, mark("lego", 16, "standard", 1));
    assert_eq!(records.readings()[0].psnr_db, Some(0.1 + 0.2));
    assert_eq!(records.readings()[0].elevation_deg, Some(vec![0.1, -12.5]));
    assert_eq!(records.readings()[0].message_right_from, [(1, true)].into());
    assert_eq!(records.detections().len(), 1);
    assert!(records.notes().is_empty());
}

#[test]
fn the_same_records_are_the_same_bytes() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    for folder in &folders {
        filled(folder.path());
    }
    assert_eq!(text(folders[0].path()), text(folders[1].path()));
}

#[test]
fn two_writers_are_refused_and_readers_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).unwrap();
    assert!(matches!(Store::open(folder.path()), Err(Error::Locked { .. })));
    Records::read(folder.path()).unwrap();
    drop(store);
    Store::open(folder.path()).unwrap();
}

#[test]
fn a_torn_last_line_is_dropped_wherever_it_tore() {
    let folder = tempfile::tempdir().unwrap();
    filled(folder.path());
    let whole = text(folder.path());
    let last = whole.trim_end().rfind('\n').unwrap() + 1;
    for end in [last + 1, last + 40, whole.len() - 2] {
        std::fs::write(folder.path().join(FILE), &whole[..end]).unwrap();
        let read = Records::read(folder.path()).unwrap();
        assert_eq!(read.readings().len(), 1);
        assert!(read.notes()[0].contains("line 3"), "{:?}", read.notes());
        assert_eq!(text(folder.path()).len(), end, "reading changes nothing");
        let mut store = Store::open(folder.path()).unwrap();
        assert_eq!(store.records().notes().len(), 1);
        let again = detection(&[mark("lego", 16, "standard", 1)]);
        store.append(Record::Detection(again)).unwrap();
        assert_eq!(text(folder.path()), whole);
    }
}

#[test]
fn a_whole_last_line_without_newline_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    filled(folder.path());
    let whole = text(folder.path());
    std::fs::write(folder.path().join(FILE), whole.trim_end()).unwrap();
    let mut store = Store::open(folder.path()).unwrap();
    assert_eq!(store.records().detections().len(), 1);
    assert_eq!(text(folder.path()), whole);
    store.append(Record::Mark(mark("ship", 16, "standard", 1))).unwrap();
    drop(store);
    assert_eq!(Records::read(folder.path()).unwrap().marks().len(), 2);
}

#[test]
fn other_damage_is_an_error_with_the_line() {
    let folder = tempfile::tempdir().unwrap();
    filled(folder.path());
    let whole = text(folder.path());
    let lines: Vec<&str> = whole.lines().collect();
    let damaged = [
        (format!("{}\n{}\n", lines[0], &lines[1][..50]), "line 2"),
        (format!("{}\n\n{}\n", lines[0], lines[1]), "line 2"),
        (format!("{}\n{}\n", lines[1], lines[0]), "line 1: mark"),
        (format!("{}\n{}\n", lines[0], lines[0]), "line 2: id"),
        (whole.replace("\"seed\":1", "\"seed\":3"), "line 1: the record is"),
        (whole.replace("[16,3]", "[17,3]"), "line 2: bits_right"),
        (whole.replace("[16,3]", "[16,-3]"), "line 2"),
    ];
    for (text, expected) in damaged {
        std::fs::write(folder.path().join(FILE), &text).unwrap();
        for error in [
            Store::open(folder.path()).unwrap_err(),
            Records::read(folder.path()).unwrap_err(),
        ] {
            assert!(error.to_string().contains(expected), "{expected}: {error}");
        }
    }
}

#[test]
fn what_does_not_fit_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    filled(folder.path());
    let before = text(folder.path());
    let mut store = Store::open(folder.path()).unwrap();
    let known = mark("lego", 16, "standard", 1);
    let stranger = mark("ship", 16, "standard", 1);
    let mut other_bits = reading(&known, "none", &[1]);
    other_bits.bits = 32;
    let mut impossible = stranger.clone();
    impossible.seconds = f64::NAN;
    for record in [
        Record::Mark(known.clone()),
        Record::Mark(impossible),
        Record::Reading(reading(&stranger, "none", &[1])),
        Record::Reading(other_bits),
        Record::Detection(detection(&[stranger])),
    ] {
        assert!(matches!(store.append(record), Err(Error::BadOption { .. })));
    }
    assert_eq!(text(folder.path()), before);
}
