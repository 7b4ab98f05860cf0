//! Every output holds every number, and nothing that a hostile name could do.
use super::*;
use crate::report::named::{Experiment, Options, all, report};
use crate::report::names::{NONE, STANDARD};
use crate::report::record::Record;
use crate::report::selection::Selection;
use crate::report::store::Records;
use crate::report::testing::{detection, mark, reading, records};

const HOSTILE: &str = "<img src=x onerror=\"alert(1)\">|a\n<!-- END capacity -->, \"b\"";

fn hostile() -> Records {
    let mut marks = [mark(HOSTILE, 16, STANDARD, 1), mark("lego", 32, STANDARD, 2)];
    marks[0].psnr_db = None;
    marks[0].difference_picture = Some("difference.png".into());
    let mut first = reading(&marks[0], NONE, &[16, 11]);
    first.elevation_deg = Some(vec![12.5, -30.0]);
    first.message_right_from.insert(2, false);
    let readings = [
        first,
        reading(&marks[1], NONE, &[31]),
        reading(&marks[0], "<b>:1", &[9]),
    ];
    let mut all: Vec<Record> = marks.iter().cloned().map(Record::Mark).collect();
    all.extend(readings.into_iter().map(Record::Reading));
    all.push(Record::Detection(detection(&marks)));
    records(all)
}

fn options() -> Options {
    Options {
        per_scene: true,
        ..Options::default()
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[test]
fn pages_hold_every_cell_and_run_nothing() {
    let records = hostile();
    let selection = Selection::newest(&records).unwrap();
    let reports = all(&selection, &options()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    image::DynamicImage::new_rgb8(2, 2)
        .save(folder.path().join("difference.png"))
        .unwrap();
    let page = to_html(&reports, folder.path());
    let mut cells = 0;
    for report in &reports {
        for cell in report
            .tables
            .iter()
            .flat_map(|table| &table.rows)
            .flat_map(|row| &row.cells)
        {
            assert!(
                page.contains(&format!(">{}</td>", escaped(&cell.to_string()))),
                "{cell}"
            );
            cells += 1;
        }
        for missing in &report.missing {
            assert!(page.contains(&escaped(missing)), "{missing}");
        }
    }
    assert!(cells > 300);
    assert!(page.contains("not measured</td>") && page.contains(">identical</td>"));
    for hostile in ["<img src=x", "<b>", "<script", "<!-- END"] {
        assert!(!page.contains(hostile), "{hostile}");
    }
    // Nothing from elsewhere: names of XML are the only addresses, and links stay in the page.
    let outside = page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    assert!(!outside.contains("http:") && !outside.contains("https:") && !outside.contains("url("));
    assert!(outside.split("href=\"").skip(1).all(|link| link.starts_with('#')));
    assert!(page.contains("<img src=\"data:image/png;base64,"));
    assert_eq!(page, to_html(&reports, folder.path()));
}

#[test]
fn a_lost_picture_is_told() {
    let records = hostile();
    let selection = Selection::newest(&records).unwrap();
    let capacity = report(Experiment::Capacity, &selection, &options()).unwrap();
    assert_eq!(capacity.pictures.len(), 1);
    let page = to_html(&[capacity], tempfile::tempdir().unwrap().path());
    assert!(page.contains("<p>difference.png: ") && !page.contains("<img"));
}

#[test]
fn csv_parses_back() {
    let records = hostile();
    let selection = Selection::newest(&records).unwrap();
    let text = to_csv(&selection).unwrap();
    let mut reader = ::csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let rows: Vec<::csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3);
    let get = |row: usize, column: &str| {
        let place = header.iter().position(|name| name == column).unwrap();
        rows[row].get(place).unwrap().to_string()
    };
    for (row, run) in selection.all_runs().iter().enumerate() {
        assert_eq!(get(row, "scene"), run.mark.embedding.scene);
        assert_eq!(get(row, "mark"), run.mark.id().to_string());
        assert_eq!(get(row, "reading"), run.reading.id().to_string());
        assert_eq!(get(row, "attack"), run.reading.attack);
        assert_eq!(get(row, "accuracy").parse::<f64>().unwrap(), run.reading.accuracy());
        let psnr = get(row, "mark_psnr_db").parse::<f64>().unwrap();
        assert_eq!(psnr, run.mark.psnr_db.unwrap_or(f64::INFINITY));
        let right: Vec<u16> = get(row, "bits_right").split(' ').map(|n| n.parse().unwrap()).collect();
        assert_eq!(right, run.reading.bits_right);
    }
    let first = (0..3).find(|row| get(*row, "views") == "2").unwrap();
    assert_eq!(get(first, "scene"), HOSTILE);
    assert_eq!(get(first, "elevation_deg"), "12.5 -30");
    assert_eq!(
        (get(first, "message_right_from_1"), get(first, "message_right_from_2")),
        ("true".into(), "false".into())
    );
    assert_eq!(get(first, "key_seconds"), "");
}

#[test]
fn json_parses_back() {
    let records = hostile();
    let selection = Selection::newest(&records).unwrap();
    let reports = all(&selection, &options()).unwrap();
    let value: serde_json::Value = serde_json::from_str(&to_json(&reports).unwrap()).unwrap();
    let rows = &value[0]["tables"][0]["rows"];
    assert_eq!(rows[0]["cells"][2]["value"]["value"], 84.375);
    assert_eq!(rows[0]["cells"][6], "identical");
    assert_eq!(rows[1]["part"], true);
    assert_eq!(rows[1]["cells"][0]["text"], HOSTILE);
    assert_eq!(rows[4]["cells"][2], "not_measured");
    assert_eq!(value[0]["name"], "capacity");
}

#[test]
fn markdown_goes_between_its_markers() {
    let records = hostile();
    let selection = Selection::newest(&records).unwrap();
    let capacity = report(Experiment::Capacity, &selection, &options()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("evaluation.md");
    std::fs::write(
        &path,
        "before\n<!-- BEGIN capacity -->\nold\n<!-- END capacity -->\nafter\n",
    )
    .unwrap();
    for _ in 0..2 {
        write_markdown(&capacity, &path).unwrap();
    }
    let document = std::fs::read_to_string(&path).unwrap();
    assert!(document.starts_with("before\n<!-- BEGIN capacity -->\n\n**Capacity"));
    assert!(document.ends_with("\n\n<!-- END capacity -->\nafter\n"));
    assert!(!document.contains("old") && !document.contains("<img"));
    let table: Vec<&str> = document.lines().filter(|line| line.starts_with('|')).collect();
    // A head, a rule, five lengths, and a scene below each of two.
    assert_eq!(table.len(), 9);
    let columns = capacity.tables[0].columns.len();
    for line in table {
        assert_eq!(line.replace("\\|", "").matches('|').count(), columns + 1, "{line}");
    }
    assert!(document.contains("| not measured |"));
    assert!(document.contains("- 48 bits, standard, none: not measured\n"));
}

#[test]
fn files_are_what_the_texts_are() {
    let records = hostile();
    let selection = Selection::newest(&records).unwrap();
    let reports = [report(Experiment::Losses, &selection, &options()).unwrap()];
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_json(&reports, &path("a.json")).unwrap();
    write_csv(&selection, &path("a.csv")).unwrap();
    write_html(&reports, folder.path(), &path("a.html")).unwrap();
    let text = |name: &str| std::fs::read_to_string(path(name)).unwrap();
    assert_eq!(text("a.json"), to_json(&reports).unwrap());
    assert_eq!(text("a.csv"), to_csv(&selection).unwrap());
    assert_eq!(text("a.html"), to_html(&reports, folder.path()));
    assert!(write_json(&reports, &path("none/a.json")).is_err());
}
