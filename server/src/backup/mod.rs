//! Backup and restore of a server that has its ledger in the data folder: a folder with a copy of the ledger as one
//! moment saw it, the bytes of all artifacts that it tells of, and `backup.json`, which comes last and says that the rest
//! is whole.
mod files;
mod restore;
mod take;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::settings::Settings;

pub use restore::restore;
pub use take::take;

/// Of the layout of a backup.
const VERSION: u32 = 1;

const MANIFEST: &str = "backup.json";
const LEDGER: &str = "ledger.sqlite";
const ARTIFACTS: &str = "artifacts";
const MASTER_KEY: &str = "master.key";

/// What a backup says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    version: u32,
    /// When it was begun: RFC 3339.
    time: String,
    /// SHA-256 of the ledger's copy, hexadecimal.
    ledger_sha256: String,
    artifacts: u64,
    artifact_bytes: u64,
    master_key: bool,
}

/// Backups are of folders; a database has its own.
fn embedded_only(settings: &Settings) -> Result<()> {
    if let Some(database) = &settings.database {
        return Err(Error::Startup(format!(
            "the ledger is in {database}: back that up as databases are (pg_dump, or archiving), and the artifacts beside \
             it afterwards"
        )));
    }
    match &settings.artifacts {
        None => Ok(()),
        Some(place) => Err(Error::Startup(format!(
            "the artifacts are in {place}, not in the data folder: keep versions of them there, and copy the ledger first"
        ))),
    }
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> Error {
    move |error| Error::Startup(format!("{}: {error}", path.display()))
}
