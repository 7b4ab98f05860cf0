//! Time against success against likeness: which settings of an embedding no others beat in all three.
use super::{Plot, Report};
use crate::error::Result;
use crate::report::interval;
use crate::report::names::{NONE, TRADE};
use crate::report::plot::{Axes, TradeOff, trade};
use crate::report::record::Timing;
use crate::report::selection::{Run, Selection};
use crate::report::summary::Summary;
use crate::report::table::{Cell, Row, Table};
use crate::statistics::{Direction, pareto_front};
use std::collections::{BTreeMap, BTreeSet};

/// Variants that plots name, and of which the first that was measured is what times are told against.
const NAMED: [&str; 4] = ["standard", "base", "draft", "paper"];
/// Numbers of views that the whole message is read from, in tables.
const VIEWS: [u32; 3] = [1, 5, 10];
/// The one that decides who is on the front: as many as `verify` asks for.
const SUCCESS_VIEWS: u32 = 5;
/// Load before a run, per core, up to which a machine is called quiet.
const QUIET: f64 = 0.15;

const COLUMNS: [&str; 12] = [
    "variant",
    "runs",
    "seconds",
    "times the reference",
    "processor seconds",
    "steps",
    "accuracy (%)",
    "message right from 1 view",
    "message right from 5 views",
    "message right from 10 views",
    "PSNR (dB)",
    "front",
];
const READING: &str = "Means over runs, a run being one mark of one scene with one seed; in brackets 95 % intervals, \
    Student's t (of times the reference: of the logarithms, run by run) and Wilson's for whole messages. Seconds are of \
    the embedding alone, and differ between scenes, so that no interval would tell anything.";
const ON_FRONT: &str = "On the front are those that no other beats in mean seconds, whole messages and PSNR at once.";

/// What is timed together: one device of one machine, with as many threads, and messages of one length.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    bits: u32,
    device: String,
    machine: String,
}

/// Runs of a variant, summed up.
struct Line<'a> {
    name: &'a str,
    runs: Vec<Run<'a>>,
    summary: Summary,
    /// Whether all scenes and seeds of the place are among its runs.
    whole: bool,
}

impl Line<'_> {
    fn seconds(&self) -> Option<f64> {
        self.summary.seconds.map(|mean| mean.mean)
    }

    /// Of views that are all identical the PSNR is infinite.
    fn psnr(&self) -> Option<f64> {
        let psnr = &self.summary.psnr;
        match (psnr.differing, psnr.identical) {
            (Some(mean), _) => Some(mean.mean),
            (None, 1..) => Some(f64::INFINITY),
            (None, 0) => None,
        }
    }

    fn success(&self, views: u32) -> Option<f64> {
        let share = self.summary.whole.get(&views)?;
        Some(share.right as f64 / share.of.max(1) as f64)
    }
}

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>) -> Result<()> {
    let places = places(selection);
    if places.is_empty() {
        report.missing.push("trade: no variant was timed".into());
        let mut cells = vec![Cell::text("any variant"), Cell::Count(0)];
        cells.resize(COLUMNS.len(), Cell::NotMeasured);
        report.tables.push(table(
            report.title.clone(),
            vec![Row::new(cells)],
            Vec::new(),
            "the reference",
        ));
    }
    for (place, variants) in places {
        let lines = lines(variants);
        let front = on_front(&lines)?;
        let title = format!(
            "{}, {} bits, {}, {}",
            report.title, place.bits, place.device, place.machine
        );
        let reference = NAMED
            .iter()
            .find_map(|name| lines.iter().find(|line| line.name == *name));
        let rows = lines.iter().map(|line| row(line, reference, front.contains(line.name)));
        let name = reference.map_or("the reference", |line| line.name);
        report
            .tables
            .push(table(title.clone(), rows.collect(), notes(&lines), name));
        let dot = |line: &Line<'_>| {
            Some(TradeOff {
                label: line.name.into(),
                named: NAMED.contains(&line.name),
                x: line.seconds()?,
                y: line.summary.accuracy?.mean,
                shade: line.psnr(),
                on_front: front.contains(line.name),
            })
        };
        let dots: Vec<TradeOff> = lines.iter().filter_map(dot).collect();
        let axes = Axes {
            title: &format!("{} bits, {}", place.bits, place.device),
            x: "seconds of an embedding",
            y: "bit accuracy (%)",
        };
        report.plots.push(Plot {
            caption: format!("{title}: coloured by PSNR, rings around the front"),
            svg: trade(axes, "PSNR (dB)", &dots)?,
        });
    }
    Ok(())
}

/// Runs by place and variant.
fn places<'a>(selection: &Selection<'a>) -> BTreeMap<Place, BTreeMap<&'a str, Vec<Run<'a>>>> {
    let mut places: BTreeMap<Place, BTreeMap<&str, Vec<Run<'_>>>> = BTreeMap::new();
    for run in selection.all_runs() {
        let embedding = &run.mark.embedding;
        let named = embedding
            .variant
            .strip_prefix(TRADE)
            .and_then(|rest| rest.split_once(':'));
        let Some((_, variant)) = named.filter(|_| run.reading.attack == NONE) else {
            continue;
        };
        let machine = |timing: &Timing| {
            let s = |count: u32| if count == 1 { "" } else { "s" };
            let (threads, cores) = (timing.threads, timing.cores);
            format!(
                "{}, {threads} thread{} on {cores} core{}",
                timing.processor,
                s(threads),
                s(cores)
            )
        };
        let place = Place {
            bits: embedding.bits,
            device: run.mark.device.clone(),
            machine: run.mark.timing.as_ref().map_or("an unknown machine".into(), machine),
        };
        places.entry(place).or_default().entry(variant).or_default().push(run);
    }
    places
}

/// One line a variant, the fastest first.
fn lines<'a>(variants: BTreeMap<&'a str, Vec<Run<'a>>>) -> Vec<Line<'a>> {
    let of_run = |run: &Run<'a>| (run.mark.embedding.scene.as_str(), run.mark.embedding.seed);
    let all: BTreeSet<(&str, u64)> = variants.values().flatten().map(of_run).collect();
    let line = |(name, runs): (&'a str, Vec<Run<'a>>)| Line {
        name,
        summary: Summary::of(&runs),
        whole: runs.iter().map(of_run).collect::<BTreeSet<_>>() == all,
        runs,
    };
    let mut lines: Vec<Line<'_>> = variants.into_iter().map(line).collect();
    lines.sort_by(|a, b| {
        let order = |line: &Line<'_>| line.seconds().unwrap_or(f64::INFINITY);
        order(a).total_cmp(&order(b)).then(a.name.cmp(b.name))
    });
    lines
}

/// Number of views that success is told from: [`SUCCESS_VIEWS`], or fewer where marks were read from fewer.
fn success_views(lines: &[Line<'_>]) -> u32 {
    let known = |views: u32| lines.iter().all(|line| line.summary.whole.contains_key(&views));
    if known(SUCCESS_VIEWS) { SUCCESS_VIEWS } else { 1 }
}

/// Names on the front; variants that lack a scene or a seed are not compared.
fn on_front<'a>(lines: &[Line<'a>]) -> Result<BTreeSet<&'a str>> {
    let views = success_views(lines);
    let point = |line: &Line<'a>| {
        let figures = [line.seconds()?, line.success(views)?, line.psnr()?];
        line.whole.then_some((line.name, figures))
    };
    let points: Vec<(&str, [f64; 3])> = lines.iter().filter_map(point).collect();
    let figures: Vec<[f64; 3]> = points.iter().map(|(_, figures)| *figures).collect();
    let front = pareto_front(
        &figures,
        &[Direction::Minimise, Direction::Maximise, Direction::Maximise],
    )?;
    Ok(front
        .into_iter()
        .filter_map(|k| points.get(k).map(|(name, _)| *name))
        .collect())
}

fn row(line: &Line<'_>, reference: Option<&Line<'_>>, on_front: bool) -> Row {
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

fn table(title: String, rows: Vec<Row>, more: Vec<String>, reference: &str) -> Table {
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

/// What the front is of, and whether the seconds can be compared.
fn notes(lines: &[Line<'_>]) -> Vec<String> {
    let mut notes = Vec::new();
    let views = success_views(lines);
    let s = if views == 1 { "" } else { "s" };
    notes.push(format!("Whole messages are told from {views} view{s} there."));
    let partial = lines.iter().filter(|line| !line.whole).count();
    if partial > 0 {
        notes.push(format!(
            "{partial} variants lack scenes or seeds that others have, and are not compared."
        ));
    }
    let runs = || lines.iter().flat_map(|line| &line.runs);
    let timings: Vec<&Timing> = runs().filter_map(|run| run.mark.timing.as_ref()).collect();
    if timings.len() < runs().count() {
        notes.push("Of some marks it was not kept where and when they were timed: seconds cannot be compared.".into());
    }
    let began: BTreeSet<&str> = timings.iter().map(|timing| timing.began.as_str()).collect();
    if let (Some(first), Some(last)) = (began.first(), began.last()) {
        notes.push(format!("Timed from {first} to {last}."));
    }
    let programs: BTreeSet<&str> = timings.iter().map(|timing| timing.run.as_str()).collect();
    if programs.len() > 1 {
        let count = programs.len();
        notes.push(format!(
            "The seconds are of {count} runs of the program: what else the machine did may have differed. Only \
             seconds of one run on a quiet machine can be compared."
        ));
    }
    let load = |timing: &&Timing| Some((timing.load_before?, timing.cores.max(1)));
    let share = |(load, cores): &(f64, u32)| load / f64::from(*cores);
    match timings.iter().filter_map(load).max_by(|a, b| share(a).total_cmp(&share(b))) {
        None => notes.push("It is not known whether the machine was quiet.".into()),
        Some(load) if share(&load) <= QUIET => notes.push("The machine was quiet before the run began.".into()),
        Some((load, cores)) => notes.push(format!(
            "The machine was not quiet: in the minute before the run its load was {load:.1}, with {cores} cores. Seconds \
             here cannot be compared with those of anywhere else, and not well with each other; processor seconds are \
             less affected."
        )),
    }
    notes
}

#[cfg(test)]
mod tests;
