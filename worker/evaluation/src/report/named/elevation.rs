//! Accuracy by the elevation of views.
use super::{Options, Plot, Report};
use crate::error::Result;
use crate::report::names::{NONE, STANDARD};
use crate::report::plot::{Axes, Line, Point, lines};
use crate::report::selection::{Run, Selection};
use crate::report::summary::Estimate;
use crate::report::table::{Cell, Row, Table};

/// Degrees of a bin; 90 is a multiple.
const BIN: f64 = 15.0;
const BINS: usize = 12;

/// Views of a bin: how many, and the accuracy of each run that has any, in percent.
struct Bin {
    views: usize,
    runs: Vec<f64>,
}

/// Bins from below to above; the last has its upper end.
fn bins(runs: &[Run<'_>]) -> Vec<Bin> {
    let bin = |place: usize| {
        let mut bin = Bin {
            views: 0,
            runs: Vec::new(),
        };
        for run in runs {
            let Some(elevations) = &run.reading.elevation_deg else {
                continue;
            };
            let views = elevations.iter().zip(&run.reading.bits_right);
            let here = views.filter(|(degrees, _)| bin_of(**degrees) == place);
            let right: Vec<u64> = here.map(|(_, right)| u64::from(*right)).collect();
            if right.is_empty() {
                continue;
            }
            let of = right.len() as f64 * f64::from(run.reading.bits);
            bin.views += right.len();
            bin.runs.push(100.0 * right.iter().sum::<u64>() as f64 / of);
        }
        bin
    };
    (0..BINS).map(bin).collect()
}

fn bin_of(degrees: f32) -> usize {
    let place = (f64::from(degrees) + 90.0) / BIN;
    (place as usize).min(BINS - 1)
}

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>, options: &Options) -> Result<()> {
    let runs = selection.runs(options.bits, STANDARD, NONE);
    let mut rows = Vec::new();
    let mut points = Vec::new();
    for (place, bin) in bins(&runs).into_iter().enumerate() {
        let low = place as f64 * BIN - 90.0;
        let estimate = Estimate::of(&bin.runs);
        let name = format!("{low:.0}° to {:.0}°", low + BIN);
        if estimate.is_none() {
            report
                .missing
                .push(format!("{} bits, elevation {name}: not measured", options.bits));
        }
        if let Some(estimate) = estimate {
            points.push(Point {
                x: low + BIN / 2.0,
                y: estimate.mean,
                interval: estimate.interval.map(|ends| ends.map(|end| end.clamp(0.0, 100.0))),
            });
        }
        let clamped = estimate.map(|mut estimate| {
            estimate.interval = estimate.interval.map(|ends| ends.map(|end| end.clamp(0.0, 100.0)));
            estimate
        });
        rows.push(Row::new(vec![
            Cell::text(name),
            Cell::Count(bin.runs.len() as u64),
            Cell::Count(bin.views as u64),
            Cell::estimate(clamped, 2),
        ]));
    }
    report.tables.push(Table {
        title: format!("{}, {} bits", report.title, options.bits),
        columns: ["elevation", "runs", "views", "accuracy (%)"]
            .map(String::from)
            .to_vec(),
        rows,
        notes: vec!["Mean over runs of the accuracy of their views in each range, lower end included.".into()],
    });
    let line = Line {
        name: format!("{} bits, mean over runs with 95 % interval", options.bits),
        points,
        dots: true,
    };
    let axes = Axes {
        title: "accuracy by elevation",
        x: "elevation (degrees)",
        y: "accuracy (%)",
    };
    report.plots.push(Plot {
        caption: "Accuracy of views by their elevation".into(),
        svg: lines(axes, &[line])?,
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{mark, reading};

    #[test]
    fn hand_computed_bins() {
        let mark = mark("lego", 32, STANDARD, 1);
        let mut first = reading(&mark, NONE, &[32, 16, 8, 0]);
        first.elevation_deg = Some(vec![-90.0, 0.0, 14.9, 90.0]);
        let mut second = reading(&mark, NONE, &[32]);
        second.elevation_deg = Some(vec![7.0]);
        let without = reading(&mark, NONE, &[0]);
        let run = |reading| Run { mark: &mark, reading };
        let bins = bins(&[run(&first), run(&second), run(&without)]);
        assert_eq!(bins.len(), 12);
        assert_eq!(bins[0].runs, [100.0]);
        // 16 and 8 of 64, and 32 of 32: a run counts once.
        assert_eq!(bins[6].runs, [37.5, 100.0]);
        assert_eq!(bins[6].views, 3);
        assert_eq!(bins[11].runs, [0.0]);
        assert_eq!(bins.iter().map(|bin| bin.views).sum::<usize>(), 5);
        assert_eq!(bin_of(-0.001), 5);
    }
}
