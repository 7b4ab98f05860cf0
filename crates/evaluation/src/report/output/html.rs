//! Reports as one page that needs nothing else: tables, plots and pictures, on screens of any size and on paper.
use super::atomic_write::write_whole;
use super::picture::inlined;
use crate::error::Result;
use crate::report::named::{Picture, Plot, Report};
use crate::report::table::{Cell, Row, Table};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::path::Path;

/// Colours are the reader's own, light or dark; wide tables scroll on a phone, and break nowhere on paper.
const STYLE: &str = "
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 0 auto; padding: 1rem; }
h2 { margin-top: 3rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.875rem; }
caption { text-align: left; font-weight: 600; padding: 0.5rem 0; }
th, td { padding: 0.25rem 0.6rem; border-bottom: 1px solid #8886; text-align: right; vertical-align: top; }
th { border-bottom-color: currentColor; }
th:first-child, td:first-child { text-align: left; }
tr.part td { opacity: 0.8; border-bottom-style: dotted; }
tr.part td:first-child { padding-left: 1.8rem; }
td.missing { font-style: italic; opacity: 0.7; }
figure { display: inline-block; margin: 1rem 1rem 1rem 0; max-width: 100%; vertical-align: top; }
figure svg, figure img { max-width: 100%; height: auto; }
figcaption, .note { font-size: 0.875rem; opacity: 0.85; max-width: 45rem; }
@media print { body { font-size: 10pt; max-width: none; } .wide { overflow: visible; } table { font-size: 7.5pt; }
  figure, tr { break-inside: avoid; } }
";

/// Reports as one HTML page; `folder` is the store's, which the paths of pictures start from.
///
/// A picture that cannot be read is replaced by the reason.
pub fn to_html(reports: &[Report], folder: &Path) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // Nothing from anywhere, whatever a scene may be called.
                meta http-equiv="Content-Security-Policy"
                    content="default-src 'none'; style-src 'unsafe-inline'; img-src data:";
                title { "GuardSplat: what marks are worth" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "GuardSplat: what marks are worth" }
                @if reports.len() > 1 {
                    nav { ul { @for report in reports { li { a href={ "#" (report.name) } { (report.title) } } } } }
                }
                @for report in reports { (section(report, folder)) }
            }
        }
    };
    page.into_string() + "\n"
}

/// Writes [`to_html`] to a file, whole or not at all.
///
/// # Errors
/// [`crate::Error::Io`].
pub fn write_html(reports: &[Report], folder: &Path, path: &Path) -> Result<()> {
    write_whole(path, to_html(reports, folder).as_bytes())
}

fn section(report: &Report, folder: &Path) -> Markup {
    let pair = &report.pair;
    html! {
        section id=(report.name) {
            h2 { (report.title) }
            p.note { "Engine " (pair.engine_version) ", CLIP " (pair.clip) " (" (pair.clip_hash) ")" }
            @for one in &report.tables { (table(one)) }
            @for one in &report.plots { (plot(one)) }
            @for one in &report.pictures { (picture(one, folder)) }
            @if !report.missing.is_empty() {
                h3 { "Not measured" }
                ul.note { @for missing in &report.missing { li { (missing) } } }
            }
            @if !report.notes.is_empty() {
                h3 { "Notes" }
                ul.note { @for note in &report.notes { li { (note) } } }
            }
        }
    }
}

fn table(table: &Table) -> Markup {
    html! {
        div.wide {
            table {
                caption { (table.title) }
                thead { tr { @for column in &table.columns { th scope="col" { (column) } } } }
                tbody { @for one in &table.rows { (row(one)) } }
            }
        }
        @for note in &table.notes { p.note { (note) } }
    }
}

fn row(row: &Row) -> Markup {
    let cell = |cell: &Cell| html! { td.missing[cell.is_missing()] { (cell.to_string()) } };
    html! { tr.part[row.part] { @for one in &row.cells { (cell(one)) } } }
}

fn plot(plot: &Plot) -> Markup {
    html! { figure { (PreEscaped(&plot.svg)) figcaption { (plot.caption) } } }
}

fn picture(picture: &Picture, folder: &Path) -> Markup {
    html! {
        figure {
            @match inlined(&folder.join(&picture.path)) {
                Ok(address) => { img src=(address) alt={ "what the mark changed: " (picture.caption) }; }
                Err(reason) => { p { (picture.path.display().to_string()) ": " (reason) } }
            }
            figcaption { (picture.caption) }
        }
    }
}
