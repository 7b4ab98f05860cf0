//! Tables of cases: one row a case, summed up over scenes and seeds, next to what the paper says.
use super::{Cell, Row, Table};
use crate::report::names::VAE;
use crate::report::paper::{Figure, Metric};
use crate::report::selection::{Run, Selection};
use crate::report::summary::Summary;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Numbers of views that a whole message is read from in tables.
pub const VIEWS: [u32; 3] = [1, 5, 10];

/// What a row is about.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// What the row is called.
    pub label: String,
    /// Bits of the message.
    pub bits: u32,
    /// Variant of the settings.
    pub variant: String,
    /// The attack.
    pub attack: String,
    /// What the paper says.
    pub paper: Option<Figure>,
}

/// What is to be reached in a case, where that is not the paper's figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bar {
    /// Bits of the message.
    pub bits: u32,
    /// Variant of the settings.
    pub variant: String,
    /// The attack.
    pub attack: String,
    /// What is compared.
    pub metric: Metric,
    /// The least that is enough, or the most for LPIPS; in the metric's unit.
    pub bar: f64,
}

/// Which columns a table has.
#[derive(Debug, Clone, Copy)]
pub struct Layout<'a> {
    /// Head of the first column.
    pub label: &'a str,
    /// Quality and seconds of the mark, or else PSNR of what the attack did.
    pub quality: bool,
    /// A row for each scene below that of all.
    pub per_scene: bool,
    /// Columns of the paper's figures.
    pub paper: bool,
    /// Bars that replace the paper's figures.
    pub bars: &'a [Bar],
}

/// A column of the paper: what is compared, its head, digits, the paper's figure, and our value.
type Compared = (
    Metric,
    &'static str,
    usize,
    fn(&Figure) -> Option<f64>,
    fn(&Summary) -> Option<f64>,
);

const COMPARED: [Compared; 4] = [
    (
        Metric::Accuracy,
        "paper: accuracy (%)",
        2,
        |figure| figure.accuracy,
        |summary| summary.accuracy.map(|mean| mean.mean),
    ),
    (
        Metric::Psnr,
        "paper: PSNR (dB)",
        2,
        |figure| figure.psnr_db,
        |summary| match (summary.psnr.differing, summary.psnr.identical) {
            (Some(mean), _) => Some(mean.mean),
            (None, 1..) => Some(f64::INFINITY),
            (None, 0) => None,
        },
    ),
    (
        Metric::Ssim,
        "paper: SSIM",
        4,
        |figure| figure.ssim,
        |summary| summary.ssim.map(|mean| mean.mean),
    ),
    (
        Metric::Lpips,
        "paper: LPIPS",
        4,
        |figure| figure.lpips,
        |summary| summary.lpips.map(|mean| mean.mean),
    ),
];

/// A table of some cases, and what of it was not measured.
pub fn grid(title: &str, cases: &[Case], selection: &Selection<'_>, layout: Layout<'_>) -> (Table, Vec<String>) {
    let compared = columns_of_paper(cases, layout);
    let mut columns: Vec<String> = vec![layout.label.into(), "runs".into(), "accuracy (%)".into()];
    columns.extend(VIEWS.map(|n| format!("message right from {n} view{}", if n == 1 { "" } else { "s" })));
    let quality: &[&str] = if layout.quality {
        &["PSNR (dB)", "SSIM", "LPIPS", "seconds"]
    } else {
        &["attacked against unattacked (dB)"]
    };
    columns.extend(quality.iter().map(|name| name.to_string()));
    columns.extend(compared.iter().map(|(_, name, ..)| name.to_string()));
    let mut rows = Vec::new();
    let mut missing = Vec::new();
    for case in cases {
        let runs = selection.runs(case.bits, &case.variant, &case.attack);
        let summary = Summary::of(&runs);
        let mut cells = measured(&case.label, &summary, layout);
        let lacking = cells.iter().zip(&columns).filter(|(cell, _)| cell.is_missing());
        let lacking: Vec<&str> = lacking.map(|(_, column)| column.as_str()).collect();
        let name = format!("{} bits, {}, {}", case.bits, case.variant, case.attack);
        let marks = selection.marks_of(case.bits, &case.variant).len();
        if runs.is_empty() {
            missing.push(match marks {
                0 => format!("{name}: not measured"),
                _ if case.attack == VAE => format!("{name}: not measured: no weights"),
                n => format!("{name}: not measured ({n} marks without this reading)"),
            });
        } else if runs.len() < marks {
            missing.push(format!("{name}: {} of {marks} marks not measured", marks - runs.len()));
        }
        if !runs.is_empty() && !lacking.is_empty() {
            missing.push(format!("{name}: {} not measured", lacking.join(", ")));
        }
        cells.extend(compared.iter().map(|column| against(case, &summary, column, layout)));
        rows.push(Row::new(cells));
        if layout.per_scene {
            rows.extend(by_scene(&runs).into_iter().map(|(scene, runs)| {
                let mut cells = measured(scene, &Summary::of(&runs), layout);
                cells.extend(compared.iter().map(|_| Cell::Empty));
                Row { part: true, cells }
            }));
        }
    }
    let table = Table {
        title: title.into(),
        columns,
        rows,
        notes: Vec::new(),
    };
    (table, missing)
}

/// The paper's columns that any of the cases has something in.
fn columns_of_paper(cases: &[Case], layout: Layout<'_>) -> Vec<&'static Compared> {
    if !layout.paper {
        return Vec::new();
    }
    let in_use = |(metric, .., figure, _): &&Compared| {
        cases.iter().any(|case| {
            let said = case.paper.as_ref().and_then(figure);
            said.is_some() || own_bar(case, *metric, layout).is_some()
        })
    };
    COMPARED.iter().filter(in_use).collect()
}

fn own_bar(case: &Case, metric: Metric, layout: Layout<'_>) -> Option<f64> {
    let is_of = |bar: &&Bar| {
        (bar.bits, bar.metric) == (case.bits, metric) && bar.variant == case.variant && bar.attack == case.attack
    };
    layout.bars.iter().find(is_of).map(|bar| bar.bar)
}

fn against(case: &Case, summary: &Summary, column: &Compared, layout: Layout<'_>) -> Cell {
    let (metric, _, decimals, figure, value) = column;
    let paper = case.paper.as_ref().and_then(figure);
    // Where the attack counts, the paper's PSNR is that of attacked marked views: nothing here is comparable.
    let comparable = layout.quality || *metric == Metric::Accuracy;
    match own_bar(case, *metric, layout).or(paper) {
        Some(bar) if comparable => Cell::Against {
            paper,
            bar,
            missed_by: value(summary).map(|value| metric.missed_by(value, bar)),
            decimals: *decimals,
        },
        Some(bar) => Cell::number(bar, *decimals),
        None => Cell::Empty,
    }
}

fn measured(label: &str, summary: &Summary, layout: Layout<'_>) -> Vec<Cell> {
    let mut cells = vec![
        Cell::text(label),
        Cell::Count(summary.runs as u64),
        Cell::estimate(summary.accuracy, 2),
    ];
    cells.extend(VIEWS.iter().map(|views| Cell::share(summary.whole.get(views))));
    if layout.quality {
        cells.extend([
            Cell::psnr(summary.psnr),
            Cell::estimate(summary.ssim, 4),
            Cell::estimate(summary.lpips, 4),
            Cell::estimate(summary.seconds, 1),
        ]);
    } else if summary.runs > 0 && summary.attacked_psnr.is_none() {
        cells.push(Cell::Empty);
    } else {
        cells.push(Cell::estimate(summary.attacked_psnr, 2));
    }
    cells
}

fn by_scene<'a>(runs: &[Run<'a>]) -> BTreeMap<&'a str, Vec<Run<'a>>> {
    let mut scenes: BTreeMap<&str, Vec<Run<'a>>> = BTreeMap::new();
    for run in runs {
        scenes.entry(&run.mark.embedding.scene).or_default().push(*run);
    }
    scenes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::names::{NONE, STANDARD};
    use crate::report::paper::{Source, figure};
    use crate::report::record::Record;
    use crate::report::testing::{mark, reading, records};

    fn case(bits: u32) -> Case {
        Case {
            label: format!("{bits}"),
            bits,
            variant: STANDARD.into(),
            attack: NONE.into(),
            paper: figure(Source::Capacity, bits, STANDARD, NONE),
        }
    }

    #[test]
    fn a_hand_computed_table() {
        let marks = [mark("lego", 16, STANDARD, 1), mark("ship", 16, STANDARD, 1)];
        let unread = mark("drums", 16, STANDARD, 1);
        let records = records([
            Record::Mark(marks[0].clone()),
            Record::Mark(marks[1].clone()),
            Record::Mark(unread),
            Record::Reading(reading(&marks[0], NONE, &[16, 16])),
            Record::Reading(reading(&marks[1], NONE, &[16, 8])),
        ]);
        let selection = Selection::newest(&records).unwrap();
        let bars = [Bar {
            bits: 16,
            variant: STANDARD.into(),
            attack: NONE.into(),
            metric: Metric::Accuracy,
            bar: 87.0,
        }];
        let layout = Layout {
            label: "bits",
            quality: true,
            per_scene: true,
            paper: true,
            bars: &bars,
        };
        let (table, missing) = grid("capacity", &[case(16), case(32)], &selection, layout);
        let text = |row: usize| table.rows[row].cells.iter().map(Cell::to_string).collect::<Vec<_>>();
        // Runs of 100 and 75 %: error 12.5, times 12.706205 is 158.8, cut at 0 and 100.
        let expected = [
            "16",
            "2",
            "87.50 (0.00 to 100.00)",
            "2 of 2 (34 to 100 %)",
            "not measured",
            "not measured",
            "40.00 (40.00 to 40.00)",
            "0.9900 (0.9900 to 0.9900)",
            "0.0020 (0.0020 to 0.0020)",
            "60.0 (60.0 to 60.0)",
            "99.64, bar 87.00 ✓",
            "41.55 (missed by 1.55)",
            "0.9957 (missed by 0.0057)",
            "0.0017 (missed by 0.0003)",
        ];
        assert_eq!(text(0), expected);
        assert_eq!(text(1)[..4], ["lego", "1", "100.00", "1 of 1 (21 to 100 %)"]);
        assert_eq!(text(2)[..3], ["ship", "1", "75.00"]);
        assert_eq!(text(3)[..3], ["32", "0", "not measured"]);
        assert_eq!(text(3)[10], "99.04");
        assert_eq!(table.columns.len(), expected.len());
        assert!(table.rows.iter().all(|row| row.cells.len() == expected.len()));
        assert_eq!(
            missing,
            [
                "16 bits, standard, none: 1 of 3 marks not measured",
                "16 bits, standard, none: message right from 5 views, message right from 10 views not measured",
                "32 bits, standard, none: not measured",
            ]
        );
    }
}
