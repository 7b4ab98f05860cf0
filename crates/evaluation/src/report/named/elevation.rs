//! Accuracy by the elevation of views.
use super::{Options, Plot, Report};
use crate::error::Result;
use crate::report::names::{NONE, RING, STANDARD};
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

/// The accuracy in a bin, in percent.
fn accuracy(bin: &Bin) -> Option<Estimate> {
    let mut estimate = Estimate::of(&bin.runs)?;
    estimate.interval = estimate.interval.map(|ends| ends.map(|end| end.clamp(0.0, 100.0)));
    Some(estimate)
}

/// A line through the bins that hold anything.
fn line(name: String, bins: &[Bin]) -> Line {
    let point = |(place, bin): (usize, &Bin)| {
        let estimate = accuracy(bin)?;
        Some(Point {
            x: low_end(place) + BIN / 2.0,
            y: estimate.mean,
            interval: estimate.interval,
        })
    };
    Line {
        name,
        points: bins.iter().enumerate().filter_map(point).collect(),
        dots: true,
    }
}

fn low_end(place: usize) -> f64 {
    place as f64 * BIN - 90.0
}

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>, options: &Options) -> Result<()> {
    let bits = options.bits;
    let sphere = bins(&selection.runs(bits, STANDARD, NONE));
    let on_ring = selection.runs(bits, RING, NONE);
    let ring = bins(&on_ring);
    let mut rows = Vec::new();
    for (place, (sphere, ring)) in sphere.iter().zip(&ring).enumerate() {
        let low = low_end(place);
        let name = format!("{low:.0}° to {:.0}°", low + BIN);
        let estimate = accuracy(sphere);
        if estimate.is_none() {
            let missing = format!("{bits} bits, elevation {name}: not measured");
            report.missing.push(missing);
        }
        rows.push(Row::new(vec![
            Cell::text(name),
            Cell::Count(sphere.runs.len() as u64),
            Cell::Count(sphere.views as u64),
            Cell::estimate(estimate, 2),
            Cell::Count(ring.runs.len() as u64),
            Cell::estimate(accuracy(ring), 2),
        ]));
    }
    if on_ring.is_empty() {
        report.missing.push(format!("{bits} bits, {RING}: not measured"));
    }
    report.tables.push(Table {
        title: format!("{}, {bits} bits", report.title),
        columns: [
            "elevation",
            "runs",
            "views",
            "accuracy (%)",
            "runs, trained on a ring",
            "accuracy, trained on a ring (%)",
        ]
        .map(String::from)
        .to_vec(),
        rows,
        notes: vec![
            "Mean over runs of the accuracy of their views in each range, lower end included. A ring is a circle of training \
             views at an elevation of 30°, as published code has them; all views that are read are over the sphere."
                .into(),
        ],
    });
    let axes = Axes {
        title: "accuracy by elevation",
        x: "elevation (degrees)",
        y: "accuracy (%)",
    };
    let mut drawn = vec![line(format!("{bits} bits, mean over runs with 95 % interval"), &sphere)];
    if !on_ring.is_empty() {
        drawn.push(line("the same, trained on a ring".into(), &ring));
    }
    report.plots.push(Plot {
        caption: "Accuracy of views by their elevation".into(),
        svg: lines(axes, &drawn)?,
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
