//! `marks`: which marks sidecars name, for who looks for the credentials of a copy.
use std::path::{Path, PathBuf};

use c2pa::validation_status::{ASSERTION_DATAHASH_MISMATCH, SIGNING_CREDENTIAL_UNTRUSTED};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::{print_json, sidecar};

/// A sidecar and the marks that it names.
#[derive(Serialize)]
struct Named {
    path: PathBuf,
    /// The active manifest's identifier; null where the file is none that can be read.
    manifest: Option<String>,
    /// Whether the manifest is as it was signed. Whether its scene is says `check`.
    intact: bool,
    /// Values of soft bindings, base64.
    marks: Vec<String>,
    /// Why nothing was read.
    reason: Option<String>,
}

/// Prints all of them; a file that is no sidecar is told and does not stop the others.
pub fn run(paths: &[PathBuf]) -> Result<()> {
    let named: Vec<Named> = paths
        .iter()
        .map(|path| {
            read(path).unwrap_or_else(|error| Named {
                path: path.clone(),
                manifest: None,
                intact: false,
                marks: Vec::new(),
                reason: Some(error.to_string()),
            })
        })
        .collect();
    print_json(&named)
}

fn read(path: &Path) -> Result<Named> {
    let bytes = sidecar::read(path)?;
    let not_one = |error: c2pa::Error| Error::file(path, format!("not content credentials: {error}"));
    // Without a scene: that the hash of none is another is no news.
    let reader = sidecar::reader(None)
        .and_then(|reader| reader.with_manifest_data_and_stream(&bytes, "application/octet-stream", std::io::empty()))
        .map_err(not_one)?;
    let expected = [ASSERTION_DATAHASH_MISMATCH, SIGNING_CREDENTIAL_UNTRUSTED];
    let manifest = reader.active_manifest();
    Ok(Named {
        path: path.into(),
        manifest: reader.active_label().map(str::to_owned),
        intact: reader
            .validation_status()
            .into_iter()
            .flatten()
            .all(|status| expected.contains(&status.code())),
        marks: manifest
            .map(sidecar::marks)
            .unwrap_or_default()
            .iter()
            .map(|value| value.text())
            .collect(),
        reason: None,
    })
}
