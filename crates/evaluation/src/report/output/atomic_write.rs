//! Files that appear whole or not at all.
use crate::error::{Error, Result};
use std::io::Write;
use std::path::Path;

/// Writes a file under a temporary name in the same folder, makes it durable, and only then gives it its name.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let attempt = || -> std::io::Result<()> {
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".guardsplat-").suffix(".part");
        #[cfg(unix)]
        {
            // Like any new file: what the user's mask allows, not the privacy of a temporary one.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let mut file = builder.tempfile_in(folder)?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    };
    attempt().map_err(Error::io(path))
}
