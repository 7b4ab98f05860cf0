//! The reports that there are: which records each is made of, and how it lays them out.
mod cases;
mod claims;
mod elevation;
mod figures;
mod robustness;
mod security;
mod trade;

pub use robustness::to_csv as robustness_csv;

use super::paper::ABLATION_BITS;
use super::selection::{Pair, Selection};
use super::table::{Bar, Layout, Table, grid};
use crate::error::{Error, Result};
use serde::Serialize;
use std::path::PathBuf;

/// A report that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Experiment {
    /// Accuracy and quality by bits (the paper's Table 1).
    Capacity,
    /// Accuracy and matches under attacks on pictures, beside what is asked (and Table 2).
    Robustness,
    /// What is learned of the Gaussians (Table 3).
    Trained,
    /// Which losses count (Table 4).
    Losses,
    /// Gaussians removed (Table S1).
    Pruning,
    /// Messages longer than the paper's (Table S2).
    Longer,
    /// Noise on the spherical harmonics, and views covered in part.
    Perturbations,
    /// Other weights of each loss.
    Sensitivity,
    /// Accuracy by the elevation of views.
    Elevation,
    /// Other formats, and back.
    Formats,
    /// What detectors without a key see.
    Security,
    /// Claims that are right, and claims that are wrong.
    Claims,
    /// Time against success against likeness, over settings of the embedding.
    Trade,
}

impl Experiment {
    /// All of them, in the order in which they are told.
    pub const ALL: [Experiment; 13] = [
        Experiment::Capacity,
        Experiment::Robustness,
        Experiment::Trained,
        Experiment::Losses,
        Experiment::Pruning,
        Experiment::Longer,
        Experiment::Perturbations,
        Experiment::Sensitivity,
        Experiment::Elevation,
        Experiment::Formats,
        Experiment::Security,
        Experiment::Claims,
        Experiment::Trade,
    ];

    /// What it is called on a command line and between markers, such as "capacity".
    pub fn name(self) -> &'static str {
        match self {
            Experiment::Capacity => "capacity",
            Experiment::Robustness => "robustness",
            Experiment::Trained => "trained",
            Experiment::Losses => "losses",
            Experiment::Pruning => "pruning",
            Experiment::Longer => "longer",
            Experiment::Perturbations => "perturbations",
            Experiment::Sensitivity => "sensitivity",
            Experiment::Elevation => "elevation",
            Experiment::Formats => "formats",
            Experiment::Security => "security",
            Experiment::Claims => "claims",
            Experiment::Trade => "trade",
        }
    }

    /// The report of this name.
    pub fn of_name(name: &str) -> Option<Experiment> {
        Experiment::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// What it shows.
    pub fn title(self) -> &'static str {
        match self {
            Experiment::Capacity => "Capacity: accuracy and quality by length of the message",
            Experiment::Robustness => "Robustness: accuracy under attacks on pictures",
            Experiment::Trained => "What is learned of the Gaussians",
            Experiment::Losses => "Which losses count",
            Experiment::Pruning => "Gaussians removed",
            Experiment::Longer => "Longer messages",
            Experiment::Perturbations => "Noise on the colours, and views covered in part",
            Experiment::Sensitivity => "Other weights of the losses",
            Experiment::Elevation => "Accuracy by elevation of the view",
            Experiment::Formats => "Other formats, and back",
            Experiment::Security => "What detectors without a key see",
            Experiment::Claims => "Claims: right ones found, wrong ones refused",
            Experiment::Trade => "Time against success against likeness",
        }
    }
}

/// How reports are made.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Bits of the messages in reports for which the paper has none: all but capacity, longer messages, robustness and
    /// the ablations.
    pub bits: u32,
    /// A row for each scene.
    pub per_scene: bool,
    /// Columns of the paper's figures.
    pub paper: bool,
    /// What is to be reached, where that is not the paper's figure.
    pub bars: Vec<Bar>,
    /// Most difference pictures in a report.
    pub pictures: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            bits: ABLATION_BITS,
            per_scene: false,
            paper: true,
            bars: Vec::new(),
            pictures: 12,
        }
    }
}

/// A plot of a report.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// What it shows.
    pub caption: String,
    /// An SVG document without a prologue, to be put into a page as it is.
    pub svg: String,
}

/// A difference picture of a mark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Of which mark.
    pub caption: String,
    /// Where it is, in the folder of the store.
    pub path: PathBuf,
}

/// A report: tables, plots, and what is missing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Its name, see [`Experiment::name`].
    pub name: String,
    /// What it shows.
    pub title: String,
    /// Engine version and CLIP of all that is in it.
    pub pair: Pair,
    /// Its tables.
    pub tables: Vec<Table>,
    /// Its plots.
    #[serde(skip)]
    pub plots: Vec<Plot>,
    /// Difference pictures.
    pub pictures: Vec<Picture>,
    /// What was not measured, by case.
    pub missing: Vec<String>,
    /// What was left out, and what a reader should know.
    pub notes: Vec<String>,
}

/// Makes a report of what is there.
///
/// # Errors
/// [`Error::Codec`] if a plot cannot be drawn.
pub fn report(kind: Experiment, selection: &Selection<'_>, options: &Options) -> Result<Report> {
    let mut report = Report {
        name: kind.name().into(),
        title: kind.title().into(),
        pair: selection.pair().clone(),
        tables: Vec::new(),
        plots: Vec::new(),
        pictures: Vec::new(),
        missing: Vec::new(),
        notes: selection.notes().to_vec(),
    };
    match kind {
        Experiment::Robustness => robustness::fill(&mut report, selection, options)?,
        Experiment::Elevation => elevation::fill(&mut report, selection, options)?,
        Experiment::Security => security::fill(&mut report, selection)?,
        Experiment::Claims => claims::fill(&mut report, selection)?,
        Experiment::Trade => trade::fill(&mut report, selection)?,
        _ => {}
    }
    for section in cases::sections(kind, selection, options) {
        let layout = Layout {
            label: section.label,
            quality: section.quality,
            per_scene: options.per_scene,
            paper: options.paper,
            bars: &options.bars,
        };
        let (mut table, missing) = grid(&section.title, &section.cases, selection, layout);
        table.notes.extend(section.notes.iter().map(|note| note.to_string()));
        report.tables.push(table);
        report.missing.extend(missing);
        report.plots.extend(figures::of_section(kind, &section, selection)?);
        if section.quality {
            figures::pictures(&mut report, &section, selection, options.pictures);
        }
    }
    Ok(report)
}

/// Makes reports of everything.
///
/// # Errors
/// [`Error::Codec`] if a plot cannot be drawn.
pub fn all(selection: &Selection<'_>, options: &Options) -> Result<Vec<Report>> {
    Experiment::ALL
        .into_iter()
        .map(|kind| report(kind, selection, options))
        .collect()
}

impl std::str::FromStr for Experiment {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Experiment::of_name(name).ok_or_else(|| Error::BadOption {
            field: "report",
            reason: format!("{name} is none of {}", Experiment::ALL.map(Experiment::name).join(", ")),
        })
    }
}

#[cfg(test)]
mod tests;
