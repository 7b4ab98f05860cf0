//! Reports as JSON: every number of every table, to the last digit.
use super::atomic_write::write_whole;
use crate::error::{Error, Result};
use crate::report::named::Report;
use std::path::Path;

/// Reports as an indented JSON array.
///
/// # Errors
/// [`Error::Codec`] if a path of a picture is not Unicode.
pub fn to_json(reports: &[Report]) -> Result<String> {
    let text = serde_json::to_string_pretty(reports).map_err(|e| Error::Codec {
        codec: "JSON",
        reason: e.to_string(),
    })?;
    Ok(text + "\n")
}

/// Writes [`to_json`] to a file, whole or not at all.
///
/// # Errors
/// Those of [`to_json`], and [`Error::Io`].
pub fn write_json(reports: &[Report], path: &Path) -> Result<()> {
    write_whole(path, to_json(reports)?.as_bytes())
}
