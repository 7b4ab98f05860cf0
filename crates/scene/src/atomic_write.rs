//! Files that appear whole or not at all.
use crate::{Error, Result};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Writes a file under a temporary name in the same folder, makes it durable, and only then gives it its name.
///
/// Whatever fails, an older file of that name stays as it was and nothing new is left behind.
///
/// # Errors
/// [`Error::Io`]: no such folder, no permission, disk full; or `path` is something else than a regular file, such as
/// a device, which a rename would replace.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    Pending::write(path, write)?.finish()
}

/// Fills a folder under a temporary name beside `path`, and only then gives it its name, which nothing may have yet.
///
/// # Errors
/// [`Error::Io`] as for [`write_whole`], and those of `fill`; nothing is left behind.
pub fn write_folder_whole<E: From<Error>>(path: &Path, fill: impl FnOnce(&Path) -> Result<(), E>) -> Result<(), E> {
    if path.exists() {
        let reason = std::io::Error::new(
            std::io::ErrorKind::AlreadyExists,
            "a folder is written under a new name",
        );
        return Err(Error::io(path)(reason).into());
    }
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        // Like any new folder: what the user's mask allows, not the privacy of a temporary one.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o777));
    }
    builder.prefix(".guardsplat-").suffix(".part");
    let aside = builder.tempdir_in(folder(path)).map_err(Error::io(path))?;
    fill(aside.path())?;
    std::fs::rename(aside.path(), path).map_err(Error::io(path))?;
    // What was renamed is not there to be deleted.
    let _ = aside.keep();
    Ok(())
}

/// A file that is whole and durable, and has yet to get its name; else it is deleted.
pub(crate) struct Pending {
    file: NamedTempFile,
    path: PathBuf,
}

impl Pending {
    /// Writes a file under a temporary name, as [`write_whole`].
    pub fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<Pending> {
        let file = aside(path, write).map_err(Error::io(path))?;
        Ok(Pending {
            file,
            path: path.into(),
        })
    }

    /// Gives it its name.
    pub fn finish(self) -> Result<()> {
        let Pending { file, path } = self;
        file.persist(&path).map_err(|e| Error::io(&path)(e.error))?;
        // The name is durable once the folder is; not every file system can do that, and the file is whole anyway.
        let _ = std::fs::File::open(folder(&path)).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn aside(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> std::io::Result<NamedTempFile> {
    if std::fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        return Err(std::io::Error::other("exists and is not a regular file"));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".guardsplat-").suffix(".part");
    #[cfg(unix)]
    {
        // Like any new file: what the user's mask allows, not the privacy of a temporary one.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder.tempfile_in(folder(path))?;
    let mut out = BufWriter::with_capacity(1 << 20, file);
    write(&mut out)?;
    let file = out.into_inner().map_err(std::io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failing_write_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.ply");
        std::fs::write(&path, "before").unwrap();
        let full = || std::io::Error::from(std::io::ErrorKind::StorageFull);
        let error = write_whole(&path, |out| {
            out.write_all(&[0; 3 << 20])?;
            Err(full())
        });
        assert!(matches!(error, Err(Error::Io { source, .. }) if source.kind() == full().kind()));
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write_whole(&path, |out| out.write_all(b"after")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"after");
    }

    #[test]
    fn folders_and_devices_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write_whole(folder.path(), |_| Ok(())).is_err());
        assert!(write_whole(&folder.path().join("none/scene.ply"), |_| Ok(())).is_err());
        #[cfg(target_os = "linux")]
        assert!(write_whole(Path::new("/dev/full"), |_| Ok(())).is_err());
    }
}
