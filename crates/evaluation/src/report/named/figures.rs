//! Plots and pictures of sections.
use super::cases::Section;
use super::{Experiment, Picture, Plot, Report};
use crate::error::Result;
use crate::report::plot::{Axes, Bar, Dot, Line, Point, bars, lines, scatter};
use crate::report::selection::Selection;
use crate::report::summary::{Estimate, Summary};
use crate::report::table::Case;
use std::collections::BTreeSet;

/// Views that a message is read from for "success": the hardest case.
const SUCCESS_VIEWS: u32 = 1;

/// Plots of a section.
pub(super) fn of_section(kind: Experiment, section: &Section, selection: &Selection<'_>) -> Result<Vec<Plot>> {
    let summaries: Vec<(&Case, Summary)> = section
        .cases
        .iter()
        .map(|case| {
            (
                case,
                Summary::of(&selection.runs(case.bits, &case.variant, &case.attack)),
            )
        })
        .collect();
    let mut plots = Vec::new();
    if matches!(kind, Experiment::Capacity | Experiment::Longer) {
        plots.push(by_bits(
            "accuracy (%)",
            &summaries,
            |s| s.accuracy,
            |case| case.paper?.accuracy,
        )?);
        plots.push(by_bits(
            "PSNR (dB)",
            &summaries,
            |s| s.psnr.differing,
            |case| case.paper?.psnr_db,
        )?);
    } else {
        plots.push(by_case(section, &summaries)?);
    }
    if section.quality {
        plots.push(trade(section, &summaries)?);
    }
    Ok(plots)
}

fn by_bits(
    what: &str,
    summaries: &[(&Case, Summary)],
    value: fn(&Summary) -> Option<Estimate>,
    paper: fn(&Case) -> Option<f64>,
) -> Result<Plot> {
    let measured = summaries.iter().filter_map(|(case, summary)| {
        let estimate = value(summary)?;
        Some(Point {
            x: case.bits.into(),
            y: estimate.mean,
            interval: estimate.interval,
        })
    });
    let told = summaries.iter().filter_map(|(case, _)| {
        Some(Point {
            x: case.bits.into(),
            y: paper(case)?,
            interval: None,
        })
    });
    let line = |name: &str, points: Vec<Point>| Line {
        name: name.into(),
        points,
        dots: true,
    };
    let mut both = vec![line("measured", measured.collect()), line("paper", told.collect())];
    both.retain(|line| !line.points.is_empty());
    let caption = format!("{what} against bits");
    let axes = Axes {
        title: &caption,
        x: "bits",
        y: what,
    };
    let svg = lines(axes, &both)?;
    Ok(Plot { caption, svg })
}

fn by_case(section: &Section, summaries: &[(&Case, Summary)]) -> Result<Plot> {
    let bar = |(case, summary): &(&Case, Summary)| Bar {
        label: case.label.clone(),
        value: summary.accuracy.map(|mean| mean.mean),
        interval: summary.accuracy.and_then(|mean| mean.interval),
        reference: case.paper.and_then(|figure| figure.accuracy),
    };
    let all: Vec<Bar> = summaries.iter().map(bar).collect();
    let axes = Axes {
        title: &section.title,
        x: "accuracy (%)",
        y: section.label,
    };
    let svg = bars(axes, &all)?;
    let caption = format!(
        "{}: accuracy with 95 % intervals; across the bars what the paper has",
        section.title
    );
    Ok(Plot { caption, svg })
}

fn trade(section: &Section, summaries: &[(&Case, Summary)]) -> Result<Plot> {
    let dot = |(case, summary): &(&Case, Summary)| {
        let share = summary.whole.get(&SUCCESS_VIEWS)?;
        Some(Dot {
            label: case.label.clone(),
            x: summary.seconds?.mean,
            y: 100.0 * share.right as f64 / share.of.max(1) as f64,
            shade: summary.psnr.differing.map(|mean| mean.mean),
        })
    };
    let dots: Vec<Dot> = summaries.iter().filter_map(dot).collect();
    let axes = Axes {
        title: "time against success",
        x: "seconds of an embedding",
        y: "whole message from one view (%)",
    };
    let svg = scatter(axes, "PSNR (dB)", &dots)?;
    let caption = format!(
        "{}: time against success, coloured by PSNR, with the front",
        section.title
    );
    Ok(Plot { caption, svg })
}

/// Adds difference pictures: of each case and scene the first, while there is room.
pub(super) fn pictures(report: &mut Report, section: &Section, selection: &Selection<'_>, most: usize) {
    let mut left_out = 0;
    for case in &section.cases {
        let mut shown = BTreeSet::new();
        for mark in selection.marks_of(case.bits, &case.variant) {
            let scene = mark.embedding.scene.as_str();
            let Some(path) = &mark.difference_picture else {
                continue;
            };
            if !shown.insert(scene) {
                continue;
            }
            if report.pictures.len() >= most {
                left_out += 1;
                continue;
            }
            report.pictures.push(Picture {
                caption: format!("{scene}, {} bits, {}", case.bits, case.variant),
                path: path.clone(),
            });
        }
    }
    if left_out > 0 {
        report
            .notes
            .push(format!("{left_out} difference pictures are not shown"));
    }
}
