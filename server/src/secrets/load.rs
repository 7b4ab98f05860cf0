//! Where the master key comes from: the environment, a file that a setting names, or the data folder.
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use secrecy::zeroize::Zeroizing;
use secrecy::{ExposeSecret, SecretString};

use super::{MasterKey, SecretError, SecretResult};

/// The environment variable that may hold the master key.
pub const MASTER_KEY_VARIABLE: &str = "GUARDSPLAT_MASTER_KEY";
/// The master key in the data folder, when no other is named.
const KEY_FILE: &str = "master.key";
/// Id of the master key that the data folder was begun with.
const ID_FILE: &str = "master.id";

/// What says which master key is used.
#[derive(Debug)]
pub enum KeySource<'a> {
    /// The digits themselves, from the environment.
    Environment(&'a SecretString),
    /// A file that a setting names.
    File(&'a Path),
    /// The data folder's own, made when the folder is new.
    DataFolder,
}

/// Loads the master key. A data folder stays with the master key it was begun with: another one, or a new one in place
/// of one that was lost, could not open the keys that are kept, and that is better said now than when a job needs one.
pub fn load(source: KeySource<'_>, data_folder: &Path) -> SecretResult<MasterKey> {
    let id_file = data_folder.join(ID_FILE);
    let known = read(&id_file)?;
    let own = data_folder.join(KEY_FILE);
    let (key, place) = match source {
        KeySource::Environment(digits) => (
            MasterKey::from_hex(digits.expose_secret(), MASTER_KEY_VARIABLE)?,
            MASTER_KEY_VARIABLE.to_owned(),
        ),
        KeySource::File(path) => (
            read_key(path)?.ok_or_else(|| missing_setting(path))?,
            path.display().to_string(),
        ),
        KeySource::DataFolder => {
            let key = match read_key(&own)? {
                Some(key) => key,
                None if known.is_some() => return Err(SecretError::Missing { path: own }),
                None => create(&own)?,
            };
            (key, own.display().to_string())
        }
    };
    match known {
        Some(needed) if needed.trim() != key.id() => Err(SecretError::OtherKey {
            place,
            given: key.id(),
            needed: needed.trim().to_owned(),
        }),
        Some(_) => Ok(key),
        None => {
            write(&id_file, &key.id())?;
            Ok(key)
        }
    }
}

fn missing_setting(path: &Path) -> SecretError {
    SecretError::File {
        path: path.to_owned(),
        source: io::Error::from(nix::errno::Errno::ENOENT),
    }
}

fn create(path: &Path) -> SecretResult<MasterKey> {
    let key = MasterKey::generate()?;
    let digits = Zeroizing::new(hex::encode(key.bytes()));
    write(path, &digits)?;
    tracing::info!(path = %path.display(), "a master key was made; without it no key that is kept can be read");
    Ok(key)
}

fn read_key(path: &Path) -> SecretResult<Option<MasterKey>> {
    let Some(digits) = read(path)? else { return Ok(None) };
    let others = fs::metadata(path).is_ok_and(|file| file.mode() & 0o007 != 0);
    if others {
        tracing::warn!(path = %path.display(), "the master key can be read by every user of this machine");
    }
    MasterKey::from_hex(&digits, &path.display().to_string()).map(Some)
}

fn read(path: &Path) -> SecretResult<Option<Zeroizing<String>>> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(Zeroizing::new(text))),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(SecretError::File {
            path: path.to_owned(),
            source,
        }),
    }
}

/// Writes a file for the owner alone, all of it or nothing, so that it is there after a power cut.
fn write(path: &Path, text: &str) -> SecretResult<()> {
    let failed = |source| SecretError::File {
        path: path.to_owned(),
        source,
    };
    let staged = path.with_added_extension("new");
    // Left by a server that was killed while it wrote.
    match fs::remove_file(&staged) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(error)),
        _ => {}
    }
    let mut file = OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&staged)
        .map_err(failed)?;
    file.write_all(text.as_bytes())
        .and_then(|()| file.write_all(b"\n"))
        .and_then(|()| file.sync_all())
        .and_then(|()| fs::rename(&staged, path))
        .and_then(|()| File::open(path.parent().unwrap_or(Path::new(".")))?.sync_all())
        .map_err(failed)
}
