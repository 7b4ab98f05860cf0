//! `marks`: which marks sidecars name, for who looks for the credentials of a copy.
use std::path::{Path, PathBuf};

use c2pa::validation_status::{ASSERTION_DATAHASH_MISMATCH, SIGNING_CREDENTIAL_UNTRUSTED};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::{print_json, scene_file, sidecar};

/// A sidecar and the marks that it names.
#[derive(Serialize)]
pub struct Named {
    /// The file.
    pub path: PathBuf,
    /// The active manifest's identifier; null where the file is none that can be read.
    pub manifest: Option<String>,
    /// Whether the manifest is as it was signed. Whether its scene is says `check`.
    pub intact: bool,
    /// Values of soft bindings, base64.
    pub marks: Vec<String>,
    /// Manifests in it: those that the active one builds on, and itself.
    pub manifests: usize,
    /// Why nothing was read.
    pub reason: Option<String>,
}

/// Prints all of them; a file that is no sidecar is told and does not stop the others.
pub fn run(paths: &[PathBuf]) -> Result<()> {
    print_json(&paths.iter().map(|path| read_or_reason(path)).collect::<Vec<_>>())
}

/// What a sidecar names, or why it names nothing.
pub fn read_or_reason(path: &Path) -> Named {
    read(path).unwrap_or_else(|error| Named {
        path: path.into(),
        manifest: None,
        intact: false,
        marks: Vec::new(),
        manifests: 0,
        reason: Some(error),
    })
}

fn read(path: &Path) -> Result<Named, String> {
    let bytes = sidecar::read(path).map_err(|error| match error {
        Error::Io { source, .. } => source.to_string(),
        Error::File { reason, .. } => reason,
        other => other.to_string(),
    })?;
    // Without a scene: that the hash of none is another is no news.
    let reader = sidecar::reader(None)
        .and_then(|reader| reader.with_manifest_data_and_stream(&bytes, scene_file::MEDIA_TYPE, std::io::empty()))
        .map_err(|error| format!("not content credentials: {error}"))?;
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
        manifests: reader.manifests().len(),
        reason: None,
    })
}
