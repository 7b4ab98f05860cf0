//! Tables as Markdown, to be pasted into documents.
use super::markers::replace_in_file;
use crate::error::Result;
use crate::report::named::Report;
use crate::report::table::Table;
use std::fmt::Write;
use std::path::Path;

/// A report's tables, with what is missing and how they are to be read.
pub fn to_markdown(report: &Report) -> String {
    let mut out = String::new();
    for table in &report.tables {
        table_to_markdown(&mut out, table);
    }
    if !report.missing.is_empty() {
        out.push_str("Not measured:\n\n");
        for missing in &report.missing {
            line(&mut out, format_args!("- {}", escaped(missing)));
        }
        out.push('\n');
    }
    for note in &report.notes {
        line(&mut out, format_args!("Note: {}.\n", escaped(note)));
    }
    let pair = &report.pair;
    let (version, clip) = (escaped(&pair.engine_version), escaped(&pair.clip));
    line(
        &mut out,
        format_args!("Engine {version}, CLIP {clip} ({}).", escaped(&pair.clip_hash)),
    );
    out
}

/// Puts [`to_markdown`] into a document, between the markers that have the report's name.
///
/// # Errors
/// Those of [`replace_in_file`].
pub fn write_markdown(report: &Report, path: &Path) -> Result<()> {
    replace_in_file(path, &report.name, &to_markdown(report))
}

fn table_to_markdown(out: &mut String, table: &Table) {
    line(out, format_args!("**{}**\n", escaped(&table.title)));
    row(out, table.columns.iter().map(|column| escaped(column)));
    // Names to the left, numbers to the right.
    row(
        out,
        (0..table.columns.len()).map(|column| if column == 0 { "---" } else { "---:" }.to_string()),
    );
    for table_row in &table.rows {
        let cells = table_row.cells.iter().enumerate().map(|(column, cell)| {
            let text = escaped(&cell.to_string());
            match (column, table_row.part) {
                (0, true) => format!("· {text}"),
                _ => text,
            }
        });
        row(out, cells);
    }
    out.push('\n');
    for note in &table.notes {
        line(out, format_args!("{}\n", escaped(note)));
    }
}

fn row(out: &mut String, cells: impl Iterator<Item = String>) {
    let cells: Vec<String> = cells.collect();
    line(out, format_args!("| {} |", cells.join(" | ")));
}

fn line(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = writeln!(out, "{text}");
}

/// A text that Markdown shows as it is: no markup, no HTML, no ends of cells or lines.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for char in text.chars() {
        match char {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '|' | '\\' | '`' | '*' | '_' | '[' | ']' | '$' | '~' => {
                out.push('\\');
                out.push(char);
            }
            char if char.is_control() => out.push(' '),
            char => out.push(char),
        }
    }
    out
}
