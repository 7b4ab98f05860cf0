//! Takes a backup, also of a server that runs and takes work meanwhile.
use std::io::ErrorKind;
use std::path::Path;
use std::time::SystemTime;

use super::{ARTIFACTS, LEDGER, MANIFEST, MASTER_KEY, Manifest, VERSION, embedded_only, failed, files};
use crate::artifacts::ArtifactPath;
use crate::error::{Error, Result};
use crate::ledger::ArtifactRow;
use crate::ledger::sqlite::copy;
use crate::offline::Said;
use crate::run::startup;
use crate::settings::Settings;

/// Copies what a server keeps to a folder that is empty, or not there yet.
///
/// The ledger comes first, so that every artifact it tells of was there when it was copied; one that was deleted since is
/// told as deleted in the copy too.
pub async fn take(settings: &Settings, to: &Path, with_master_key: bool) -> Result<Said> {
    embedded_only(settings)?;
    let data = &settings.data_dir;
    let ledger = data.join(LEDGER);
    if !ledger.is_file() {
        return Err(Error::Startup(format!("{} is not there", ledger.display())));
    }
    files::make_folder(to).map_err(failed(to))?;
    if !files::is_empty_but(to, &[]).map_err(failed(to))? {
        return Err(Error::Startup(format!("{} is not empty", to.display())));
    }
    let time = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let target = to.join(LEDGER);
    copy::copy(&ledger, &target).await.map_err(startup)?;
    let mut said = Said::default();
    let (mut artifacts, mut bytes, mut gone, mut damaged) = (0, 0, Vec::new(), 0_u64);
    for row in copy::kept(&target).await.map_err(startup)? {
        match copy_artifact(&row, &data.join(ARTIFACTS), &to.join(ARTIFACTS))? {
            Some(copied) => {
                artifacts += 1;
                bytes += copied.bytes;
                if !is_whole(&row, &copied) {
                    damaged += 1;
                    said.err.push(format!("artifacts/{} is damaged", row.id));
                }
            }
            None if copy::is_deleted(&ledger, row.id).await.map_err(startup)? => gone.push(row.id),
            None => {
                damaged += 1;
                said.err.push(format!("artifacts/{} is gone", row.id));
            }
        }
    }
    copy::mark_deleted(&target, &gone).await.map_err(startup)?;
    let master_key = with_master_key && copy_master_key(data, to)?;
    files::sync_folders(to).map_err(failed(to))?;
    let manifest = Manifest {
        version: VERSION,
        time,
        // SQLite leaves what `VACUUM INTO` wrote to the system. All other files were synced when they were copied.
        ledger_sha256: files::hash_durably(&target).map_err(failed(&target))?.sha256,
        artifacts,
        artifact_bytes: bytes,
        master_key,
    };
    write_manifest(to, &manifest)?;
    said.out.push(format!(
        "{}: the ledger, and {artifacts} artifacts of {bytes} bytes",
        to.display()
    ));
    said.err.push(about_master_key(with_master_key, master_key).into());
    match damaged {
        0 => Ok(said),
        count => Err(Error::Startup(format!(
            "{} has everything but {count} artifacts whose bytes are not what they were: {}",
            to.display(),
            said.err.join("; ")
        ))),
    }
}

/// The bytes of an artifact, as they lie; none where they are gone.
fn copy_artifact(row: &ArtifactRow, from: &Path, to: &Path) -> Result<Option<files::Copied>> {
    // A path that the store never made leads nowhere.
    let path = ArtifactPath::parse(&row.path)?.to_string();
    let (from, to) = (from.join(&path), to.join(&path));
    match files::copy(&from, &to) {
        Ok(copied) => Ok(Some(copied)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed(&from)(error)),
    }
}

/// Whether bytes are those that the ledger tells of. Key files lie sealed, and show by themselves whether they are whole
/// when they are opened.
pub(super) fn is_whole(row: &ArtifactRow, copied: &files::Copied) -> bool {
    row.secret || (copied.sha256 == row.sha256 && u64::try_from(row.size) == Ok(copied.bytes))
}

fn copy_master_key(data: &Path, to: &Path) -> Result<bool> {
    let (from, to) = (data.join(MASTER_KEY), to.join(MASTER_KEY));
    match files::copy(&from, &to) {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(failed(&from)(error)),
    }
}

fn about_master_key(asked: bool, copied: bool) -> &'static str {
    match (asked, copied) {
        (_, true) => {
            "the master key is in the backup: whoever has the backup reads every key file in it, so lock it away"
        }
        (false, false) => {
            "the master key is NOT in the backup, and without it no key can be read again: keep a copy of it elsewhere \
             (--with-master-key puts it in)"
        }
        (true, false) => {
            "the master key is NOT in the backup: it is not in the data folder, so keep the file or the variable that it \
             comes from"
        }
    }
}

fn write_manifest(to: &Path, manifest: &Manifest) -> Result<()> {
    let path = to.join(MANIFEST);
    let text = serde_json::to_vec_pretty(manifest).map_err(|error| Error::internal("writing the manifest", error))?;
    files::write(&path, &text).map_err(failed(&path))?;
    files::sync_folders(to).map_err(failed(to))
}
