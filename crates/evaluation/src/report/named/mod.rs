//! The reports that there are: which records each is made of, and how it lays them out.
mod cases;
mod claims;
mod elevation;
mod figures;
mod security;
mod trade;

use super::paper::ABLATION_BITS;
use super::selection::{Pair, Selection};
use super::table::{Bar, Layout, Table, grid};
use crate::error::{Error, Result};
use serde::Serialize;
use std::path::PathBuf;

/// A report that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Accuracy and quality by bits (the paper's Table 1).
    Capacity,
    /// Accuracy under attacks on pictures (Table 2).
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

impl Kind {
    /// All of them, in the order in which they are told.
    pub const ALL: [Kind; 13] = [
        Kind::Capacity,
        Kind::Robustness,
        Kind::Trained,
        Kind::Losses,
        Kind::Pruning,
        Kind::Longer,
        Kind::Perturbations,
        Kind::Sensitivity,
        Kind::Elevation,
        Kind::Formats,
        Kind::Security,
        Kind::Claims,
        Kind::Trade,
    ];

    /// What it is called on a command line and between markers, such as "capacity".
    pub fn name(self) -> &'static str {
        match self {
            Kind::Capacity => "capacity",
            Kind::Robustness => "robustness",
            Kind::Trained => "trained",
            Kind::Losses => "losses",
            Kind::Pruning => "pruning",
            Kind::Longer => "longer",
            Kind::Perturbations => "perturbations",
            Kind::Sensitivity => "sensitivity",
            Kind::Elevation => "elevation",
            Kind::Formats => "formats",
            Kind::Security => "security",
            Kind::Claims => "claims",
            Kind::Trade => "trade",
        }
    }

    /// The report of this name.
    pub fn of_name(name: &str) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// What it shows.
    pub fn title(self) -> &'static str {
        match self {
            Kind::Capacity => "Capacity: accuracy and quality by length of the message",
            Kind::Robustness => "Robustness: accuracy under attacks on pictures",
            Kind::Trained => "What is learned of the Gaussians",
            Kind::Losses => "Which losses count",
            Kind::Pruning => "Gaussians removed",
            Kind::Longer => "Longer messages",
            Kind::Perturbations => "Noise on the colours, and views covered in part",
            Kind::Sensitivity => "Other weights of the losses",
            Kind::Elevation => "Accuracy by elevation of the view",
            Kind::Formats => "Other formats, and back",
            Kind::Security => "What detectors without a key see",
            Kind::Claims => "Claims: right ones found, wrong ones refused",
            Kind::Trade => "Time against success against likeness",
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
    /// Its name, see [`Kind::name`].
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
pub fn report(kind: Kind, selection: &Selection<'_>, options: &Options) -> Result<Report> {
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
        Kind::Elevation => elevation::fill(&mut report, selection, options)?,
        Kind::Security => security::fill(&mut report, selection)?,
        Kind::Claims => claims::fill(&mut report, selection)?,
        Kind::Trade => trade::fill(&mut report, selection)?,
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
    Kind::ALL
        .into_iter()
        .map(|kind| report(kind, selection, options))
        .collect()
}

impl std::str::FromStr for Kind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Kind::of_name(name).ok_or_else(|| Error::BadOption {
            field: "report",
            reason: format!("{name} is none of {}", Kind::ALL.map(Kind::name).join(", ")),
        })
    }
}

#[cfg(test)]
mod tests;
