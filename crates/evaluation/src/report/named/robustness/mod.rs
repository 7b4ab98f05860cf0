//! Robustness: what marks stand, line by line, beside what is asked of them.
mod csv;
mod marks;
mod measured;
#[cfg(test)]
mod tests;

pub use csv::to_csv;

use super::{Options, Plot, Report};
use crate::error::Result;
use crate::report::names::{FORMAT, PRUNE_LOWEST_PREFIX, PRUNE_RANDOM_PREFIX, SH_DEGREE, SH_NOISE, STANDARD, VAE};
use crate::report::paper::{Metric, ROBUSTNESS_BITS, Source, figure};
use crate::report::plot::{Axes, Bar, bars};
use crate::report::selection::Selection;
use crate::report::summary::Share;
use crate::report::table::{Cell, Row, Table};
use crate::report::targets::Column;
use measured::{Case, Measured, cases};

const READING: &str = "Means over marks, a mark being one scene with one seed; in brackets 95 % intervals by Student's t, and \
    Wilson's for shares of marks. Views of one mark are not counted as independent. Each picture is read as a claim reads it.";
const CLAIMED: &str = "A mark matches when the first pictures, read together under every hypothesis, pass the acceptance rule at \
    the rate that was asked for, all hypotheses paid for.";
const WHOLE: &str = "16 bits can never match at a rate of 10^-6: together means that the whole message is right.";

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>, options: &Options) -> Result<()> {
    report.tables.push(marks::table(selection, options));
    for column in Column::ALL {
        let marks = selection.marks_of(column.bits(), column.variant()).len();
        if marks == 0 {
            report
                .missing
                .push(format!("{} bits, {}: not measured", column.bits(), column.variant()));
            continue;
        }
        let all: Vec<(Case<'_>, Measured)> = cases(column, selection)
            .into_iter()
            .map(|case| (case, case.measured(selection, None)))
            .collect();
        for (case, measured) in &all {
            report.missing.extend(missing(case, measured, marks));
        }
        report.tables.push(lines(column, &all));
        report.plots.push(plot(column, &all)?);
    }
    Ok(())
}

/// Whether an attack is on pictures, and not told by a report of its own.
fn is_of_pictures(attack: &str) -> bool {
    let others = [PRUNE_LOWEST_PREFIX, PRUNE_RANDOM_PREFIX, SH_NOISE, FORMAT, SH_DEGREE];
    !others.iter().any(|prefix| attack.starts_with(prefix))
}

fn title(column: Column) -> String {
    let what = match column {
        Column::Standard | Column::Robust => "bits of a picture",
        Column::Claims => "claims",
    };
    format!("{what}, {} at {} bits", column.variant(), column.bits())
}

fn lines(column: Column, all: &[(Case<'_>, Measured)]) -> Table {
    let together = match column.claims() {
        true => format!("match from {} pictures", column.pictures()),
        false => format!("message from {} pictures", column.pictures()),
    };
    let columns = [
        "line",
        "attack",
        "marks",
        "bits of a picture (%)",
        "asked",
        &together,
        "asked of it (%)",
        "changed by (dB)",
    ];
    let note = if column.claims() { CLAIMED } else { WHOLE };
    Table {
        title: title(column),
        columns: columns.map(String::from).to_vec(),
        rows: all
            .iter()
            .map(|(case, measured)| Row::new(row(case, measured)))
            .collect(),
        notes: vec![READING.into(), note.into()],
    }
}

fn row(case: &Case<'_>, measured: &Measured) -> Vec<Cell> {
    let Measured { summary, together } = measured;
    let accuracy = case.target.and_then(|target| target.accuracy);
    let matches = case.target.and_then(|target| target.matches);
    // The paper's decoder was trained against distortions, too.
    let paper = match case.column {
        Column::Robust => figure(Source::Robustness, ROBUSTNESS_BITS, STANDARD, case.attack),
        Column::Standard | Column::Claims => None,
    };
    let paper = paper.and_then(|figure| figure.accuracy);
    vec![
        Cell::text(case.line),
        Cell::text(case.attack),
        Cell::Count(summary.runs as u64),
        Cell::estimate(summary.accuracy, 1),
        against(
            Metric::Accuracy,
            paper,
            accuracy,
            summary.accuracy.map(|mean| mean.mean),
        ),
        Cell::share(together.as_ref()),
        against(Metric::Accuracy, None, matches, together.as_ref().map(percent)),
        match summary.attacked_psnr {
            None => Cell::Empty,
            some => Cell::estimate(some, 1),
        },
    ]
}

/// What is asked, or else what the paper says, and by how much it was missed.
fn against(metric: Metric, paper: Option<f64>, asked: Option<f64>, value: Option<f64>) -> Cell {
    asked.or(paper).map_or(Cell::Empty, |bar| Cell::Against {
        paper,
        bar,
        missed_by: value.map(|value| metric.missed_by(value, bar)),
        decimals: 1,
    })
}

fn percent(share: &Share) -> f64 {
    100.0 * share.right as f64 / share.of.max(1) as f64
}

/// What of a case was not measured, in words.
fn missing(case: &Case<'_>, measured: &Measured, marks: usize) -> Vec<String> {
    let name = case.name();
    let told = match measured.summary.runs {
        0 if case.attack == VAE => Some(format!("{name}: not measured: no weights")),
        0 => Some(format!("{name}: not measured ({marks} marks without this reading)")),
        runs if runs < marks => Some(format!("{name}: {} of {marks} marks not measured", marks - runs)),
        _ if measured.together.is_none() => Some(format!(
            "{name}: {} pictures together not measured",
            case.column.pictures()
        )),
        _ => None,
    };
    told.into_iter().collect()
}

fn plot(column: Column, all: &[(Case<'_>, Measured)]) -> Result<Plot> {
    let bar = |(case, measured): &(Case<'_>, Measured)| Bar {
        label: case.attack.into(),
        value: measured.summary.accuracy.map(|mean| mean.mean),
        interval: measured.summary.accuracy.and_then(|mean| mean.interval),
        reference: case.target.and_then(|target| target.accuracy),
    };
    let title = title(column);
    let axes = Axes {
        title: &title,
        x: "accuracy (%)",
        y: "attack",
    };
    Ok(Plot {
        svg: bars(axes, &all.iter().map(bar).collect::<Vec<_>>())?,
        caption: format!("{title}: accuracy with 95 % intervals; across the bars what is asked"),
    })
}
