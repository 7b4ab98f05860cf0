//! Makes a data folder of a backup, and looks at every byte on the way.
use std::fs;
use std::path::Path;

use super::take::is_whole;
use super::{ARTIFACTS, LEDGER, MANIFEST, MASTER_KEY, Manifest, VERSION, embedded_only, failed, files};
use crate::artifacts::ArtifactPath;
use crate::error::{Error, Result};
use crate::ledger::sqlite::copy;
use crate::ledger::{Ledger as _, SqliteLedger};
use crate::notary::Notary;
use crate::offline::Said;
use crate::run::{DataFolder, startup};
use crate::secrets::{self, KeySource};
use crate::service::clock;
use crate::settings::Settings;

/// Puts a backup into the data folder, which must be empty or not there yet. The ledger comes last: a folder without one
/// is no half of anything.
pub async fn restore(settings: &Settings, from: &Path) -> Result<Said> {
    embedded_only(settings)?;
    let manifest = manifest(from)?;
    let ledger = from.join(LEDGER);
    if files::hash(&ledger).map_err(failed(&ledger))?.sha256 != manifest.ledger_sha256 {
        let text = format!("{} is not as it was when the backup was taken", ledger.display());
        return Err(Error::Startup(text));
    }
    let folder = DataFolder::open(&settings.data_dir)?;
    let data = folder.path();
    if !files::is_empty_but(data, &["lock"]).map_err(failed(data))? {
        let text = format!("data_dir {} is not empty; name another one", data.display());
        return Err(Error::Startup(text));
    }
    let mut said = Said::default();
    let (mut artifacts, mut bytes, mut damaged) = (0_u64, 0, 0_u64);
    for row in copy::kept(&ledger).await.map_err(startup)? {
        let path = ArtifactPath::parse(&row.path)?.to_string();
        let (source, target) = (from.join(ARTIFACTS).join(&path), data.join(ARTIFACTS).join(&path));
        match files::copy(&source, &target) {
            Ok(copied) if is_whole(&row, &copied) => {
                artifacts += 1;
                bytes += copied.bytes;
            }
            Ok(_) => {
                damaged += 1;
                said.err.push(format!("artifacts/{} is damaged", row.id));
            }
            Err(error) => {
                damaged += 1;
                said.err.push(format!("artifacts/{} is not there: {error}", row.id));
            }
        }
    }
    if manifest.master_key {
        let (source, target) = (from.join(MASTER_KEY), data.join(MASTER_KEY));
        files::copy(&source, &target).map_err(failed(&source))?;
    }
    let (part, whole) = (data.join("ledger.part"), data.join(LEDGER));
    files::copy(&ledger, &part).map_err(failed(&ledger))?;
    fs::rename(&part, &whole).map_err(failed(&whole))?;
    files::sync_folders(data).map_err(failed(data))?;
    said.out.push(format!(
        "{}: the ledger as of {}, and {artifacts} artifacts of {bytes} bytes",
        data.display(),
        manifest.time
    ));
    said.err.push(try_master_key(settings, data).await?);
    match damaged {
        0 => Ok(said),
        count => Err(Error::Startup(format!(
            "{} has everything but {count} artifacts: {}",
            data.display(),
            said.err.join("; ")
        ))),
    }
}

fn manifest(from: &Path) -> Result<Manifest> {
    let path = from.join(MANIFEST);
    let bytes = fs::read(&path).map_err(|error| {
        let text = format!(
            "{}: {error}; a folder without it is no backup that was finished",
            path.display()
        );
        Error::Startup(text)
    })?;
    let manifest: Manifest = serde_json::from_slice(&bytes)
        .map_err(|error| Error::Startup(format!("{} is no manifest of a backup: {error}", path.display())))?;
    if manifest.version != VERSION {
        return Err(Error::Startup(format!(
            "{} is of version {}, and {VERSION} is known",
            path.display(),
            manifest.version
        )));
    }
    Ok(manifest)
}

/// Whether what is sealed in the ledger opens under the master key that a server would start with.
async fn try_master_key(settings: &Settings, data: &Path) -> Result<String> {
    let source = match (&settings.master_key, &settings.master_key_file) {
        (Some(digits), _) => KeySource::Environment(digits),
        (None, Some(file)) => KeySource::File(file),
        (None, None) if data.join(MASTER_KEY).is_file() => KeySource::DataFolder,
        // A server that found none would make one, which opens nothing.
        (None, None) => {
            return Ok(format!(
                "the master key is not there: put it at {} before a server is started on this folder",
                data.join(MASTER_KEY).display()
            ));
        }
    };
    let master = secrets::load(source, data).map_err(startup)?;
    let ledger = SqliteLedger::open(&data.join(LEDGER)).await.map_err(startup)?;
    let opened = Notary::open(&ledger, &master, clock::now()).await;
    ledger.close().await;
    opened.map_err(startup)?;
    Ok("the master key opens what is in it".into())
}
