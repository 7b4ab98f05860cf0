//! A table of times: a row a variant, the fastest first.
use super::line::Line;
use crate::report::interval;
use crate::report::selection::Run;
use crate::report::table::{Cell, Row, Table};

/// Numbers of views that the whole message is read from.
pub(super) const VIEWS: [u32; 3] = [1, 5, 10];

pub(super) const COLUMNS: [&str; 13] = [
    "variant",
    "runs",
    "seconds",
    "times the reference",
    "processor seconds",
    "steps",
    "accuracy (%)",
    "shared pictures (%)",
    "message right from 1 view",
    "message right from 5 views",
    "message right from 10 views",
    "PSNR (dB)",
    "front",
];
const READING: &str = "Means over runs, a run being one mark of one scene with one seed; in brackets 95 % intervals, \
    Student's t (of times the reference: of the logarithms, run by run) and Wilson's for whole messages. Seconds are of \
    the embedding alone, and differ between scenes, so that no interval would tell anything.";
const ON_FRONT: &str = "On the front are those that no other beats in mean seconds, what is read, and PSNR at once.";

pub(super) fn row(line: &Line<'_>, reference: Option<&Line<'_>>, on_front: bool) -> Row {
    let summary = &line.summary;
    let mean = |values: Vec<f64>, decimals: usize| match interval::mean(&values) {
        Some((mean, _)) => Cell::number(mean, decimals),
        None => Cell::NotMeasured,
    };
    let processor = line
        .runs
        .iter()
        .filter_map(|run| run.mark.timing.as_ref()?.processor_seconds);
    let steps = line.runs.iter().map(|run| run.mark.steps as f64);
    let front = match (line.whole, on_front) {
        (false, _) => Cell::text("not compared"),
        (true, true) => Cell::text("yes"),
        (true, false) => Cell::Empty,
    };
    let mut cells = vec![
        Cell::text(line.name),
        Cell::Count(summary.runs as u64),
        summary
            .seconds
            .map_or(Cell::NotMeasured, |mean| Cell::number(mean.mean, 1)),
        reference.map_or(Cell::NotMeasured, |reference| ratio(line, reference)),
        mean(processor.collect(), 1),
        mean(steps.collect(), 0),
        Cell::estimate(summary.accuracy, 2),
        Cell::estimate(line.shared, 2),
    ];
    cells.extend(VIEWS.map(|views| Cell::share(summary.whole.get(&views))));
    cells.push(Cell::psnr(summary.psnr));
    cells.push(front);
    Row::new(cells)
}

/// Geometric mean, over runs of the same scene and seed, of seconds against those of the reference.
fn ratio(line: &Line<'_>, reference: &Line<'_>) -> Cell {
    let logarithm = |run: &Run<'_>| {
        let same = |other: &&Run<'_>| {
            let (a, b) = (&run.mark.embedding, &other.mark.embedding);
            (&a.scene, a.seed) == (&b.scene, b.seed)
        };
        let against = reference.runs.iter().find(same)?.mark.seconds;
        Some((run.mark.seconds / against).ln()).filter(|ratio| ratio.is_finite())
    };
    let logarithms: Vec<f64> = line.runs.iter().filter_map(logarithm).collect();
    match interval::mean(&logarithms) {
        None => Cell::NotMeasured,
        Some((mean, interval)) => Cell::Value {
            value: mean.exp(),
            // The reference against itself is 1 by definition.
            interval: interval
                .filter(|_| line.name != reference.name)
                .map(|ends| ends.map(f64::exp)),
            decimals: 2,
            identical: 0,
        },
    }
}

pub(super) fn table(title: String, rows: Vec<Row>, more: Vec<String>, reference: &str) -> Table {
    let mut notes = vec![READING.to_string(), ON_FRONT.to_string()];
    notes.extend(more);
    let columns = COLUMNS.map(|name| name.replace("the reference", reference));
    Table {
        title,
        columns: columns.to_vec(),
        rows,
        notes,
    }
}
