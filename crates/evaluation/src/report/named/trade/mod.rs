//! Time against what is read of shared pictures against likeness: which settings of an embedding no others beat.
mod line;
mod notes;
mod table;

use super::{Plot, Report};
use crate::error::Result;
use crate::report::plot::{Axes, TradeOff, trade};
use crate::report::selection::Selection;
use crate::report::table::{Cell, Row};
use crate::statistics::{Direction, pareto_front};
use line::{Line, Place};

/// Variants that plots name, and of which the first that was measured is what times are told against.
const NAMED: [&str; 6] = ["standard", "base", "draft", "robust", "thorough", "paper"];
/// Whole messages decide from as many views as `verify` asks for, where shared pictures were not read.
const SUCCESS_VIEWS: u32 = 5;

/// What variants are judged by, besides seconds and PSNR.
#[derive(Clone, Copy)]
enum Reads {
    /// Bits of pictures that were shared.
    Shared,
    /// Whole messages from so many views.
    Whole(u32),
}

impl Reads {
    /// Of lines all of which have it.
    fn of<'a>(lines: impl Iterator<Item = &'a Line<'a>> + Clone) -> Self {
        let known = |views: u32| lines.clone().all(|line| line.summary.whole.contains_key(&views));
        match lines.clone().all(|line| line.shared.is_some()) {
            true => Self::Shared,
            false if known(SUCCESS_VIEWS) => Self::Whole(SUCCESS_VIEWS),
            false => Self::Whole(1),
        }
    }

    /// In percent.
    fn figure(self, line: &Line<'_>) -> Option<f64> {
        match self {
            Self::Shared => line.shared.map(|mean| mean.mean),
            Self::Whole(views) => line.success(views),
        }
    }

    /// What plots show upwards; where shared pictures were not read, bits of pictures as they are tell more than whole
    /// messages do.
    fn shown(self, line: &Line<'_>) -> Option<f64> {
        match self {
            Self::Shared => self.figure(line),
            Self::Whole(_) => line.summary.accuracy.map(|mean| mean.mean),
        }
    }

    fn axis(self) -> &'static str {
        match self {
            Self::Shared => "bits of shared pictures (%)",
            Self::Whole(_) => "bit accuracy (%)",
        }
    }
}

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>) -> Result<()> {
    let places = line::by_place(selection);
    if places.is_empty() {
        report.missing.push("trade: no variant was timed".into());
        let mut cells = vec![Cell::text("any variant"), Cell::Count(0)];
        cells.resize(table::COLUMNS.len(), Cell::NotMeasured);
        let rows = vec![Row::new(cells)];
        let empty = table::table(report.title.clone(), rows, Vec::new(), "the reference");
        report.tables.push(empty);
    }
    // One plot of messages of all lengths of a machine, before those of each length.
    let mut machines: Vec<(&str, &str)> = places.iter().map(|(place, _)| at(place)).collect();
    machines.sort_unstable();
    machines.dedup();
    for machine in machines {
        let here = || places.iter().filter(|(place, _)| at(place) == machine);
        if here().count() > 1 {
            let named = here()
                .flat_map(|(_, lines)| lines)
                .filter(|line| NAMED.contains(&line.name));
            let title = format!("{}, {}, {}", report.title, machine.0, machine.1);
            let label = |line: &Line<'_>| format!("{} {}", line.name, line.bits);
            let what = format!("{}; numbers are bits of a message", machine.0);
            report.plots.push(plot(&title, &what, named.collect(), true, label)?);
        }
    }
    for (place, lines) in &places {
        let reads = Reads::of(lines.iter());
        let front = on_front(reads, lines.iter())?;
        let title = format!(
            "{}, {} bits, {}, {}",
            report.title, place.bits, place.device, place.machine
        );
        let reference = NAMED
            .iter()
            .find_map(|name| lines.iter().find(|line| line.name == *name));
        let rows = lines
            .iter()
            .zip(&front)
            .map(|(line, on_front)| table::row(line, reference, *on_front));
        let (rows, notes) = (rows.collect(), notes::of(lines, reads));
        let name = reference.map_or("the reference", |line| line.name);
        report.tables.push(table::table(title.clone(), rows, notes, name));
        let what = format!("{} bits, {}", place.bits, place.device);
        let label = |line: &Line<'_>| line.name.into();
        report
            .plots
            .push(plot(&title, &what, lines.iter().collect(), false, label)?);
    }
    Ok(())
}

/// Device and machine.
fn at(place: &Place) -> (&str, &str) {
    (&place.device, &place.machine)
}

/// For each line whether it is on the front: seconds, what is read, PSNR, and bits, of which more are better. Variants that
/// lack a scene or a seed are not compared.
fn on_front<'a>(reads: Reads, lines: impl Iterator<Item = &'a Line<'a>>) -> Result<Vec<bool>> {
    let point = |line: &Line<'_>| {
        let figures = [line.seconds()?, reads.figure(line)?, line.psnr()?, f64::from(line.bits)];
        line.whole.then_some(figures)
    };
    let points: Vec<Option<[f64; 4]>> = lines.map(point).collect();
    let known: Vec<usize> = (0..points.len()).filter(|k| points[*k].is_some()).collect();
    let figures: Vec<[f64; 4]> = points.iter().flatten().copied().collect();
    let better = [
        Direction::Minimise,
        Direction::Maximise,
        Direction::Maximise,
        Direction::Maximise,
    ];
    let mut on_front = vec![false; points.len()];
    for place in pareto_front(&figures, &better)? {
        on_front[known[place]] = true;
    }
    Ok(on_front)
}

/// Seconds against what is read, coloured by PSNR. `all_named`: all labels must be there, instead of those of [`NAMED`].
fn plot(
    title: &str,
    what: &str,
    lines: Vec<&Line<'_>>,
    all_named: bool,
    label: impl Fn(&Line<'_>) -> String,
) -> Result<Plot> {
    let reads = Reads::of(lines.iter().copied());
    let front = on_front(reads, lines.iter().copied())?;
    let dot = |(line, on_front): (&&Line<'_>, bool)| {
        Some(TradeOff {
            label: label(line),
            named: all_named || NAMED.contains(&line.name),
            x: line.seconds()?,
            y: reads.shown(line)?,
            shade: line.psnr(),
            on_front,
        })
    };
    let dots: Vec<TradeOff> = lines.iter().zip(front).filter_map(dot).collect();
    let axes = Axes {
        title: what,
        x: "seconds of an embedding",
        y: reads.axis(),
    };
    Ok(Plot {
        caption: format!("{title}: coloured by PSNR, rings around the front"),
        svg: trade(axes, "PSNR (dB)", &dots)?,
    })
}

#[cfg(test)]
mod tests;
