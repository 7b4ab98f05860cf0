//! Files that appear whole or not at all.
use std::io::Write;
use std::path::{Path, PathBuf};

use guardsplat_proto::v1::Artifact;
use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// A file that is being written beside where it will be.
pub struct Destination {
    path: PathBuf,
    file: NamedTempFile,
    hasher: Sha256,
    written: u64,
}

impl Destination {
    /// Whether a file can be written here, known before the work that fills it.
    pub fn check(path: &Path) -> Result<()> {
        Self::new(path).map(|_| ())
    }

    /// Begins a file.
    pub fn new(path: &Path) -> Result<Self> {
        if path.is_dir() || path.file_name().is_none() {
            return Err(Error::io(path)(std::io::Error::other("a folder, not a file to write")));
        }
        if path == Path::new("-") {
            return Err(Error::io(path)(std::io::Error::other(
                "a file is needed, `./-` if it is called so",
            )));
        }
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            let reason = format!("there is no folder {}", folder.display());
            return Err(Error::io(path)(std::io::Error::other(reason)));
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".guardsplat-").suffix(".part");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the umask takes away what others may not do.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        Ok(Self {
            path: path.to_owned(),
            // The kind of the error alone: its text names the temporary file, which is nobody's business.
            file: builder
                .tempfile_in(folder)
                .map_err(|error| Error::io(path)(error.kind().into()))?,
            hasher: Sha256::new(),
            written: 0,
        })
    }

    /// Bytes so far.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// The next bytes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(Error::io(&self.path))?;
        self.hasher.update(bytes);
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// The error for bytes that can't be right.
    pub fn damaged(&self, reason: impl Into<String>) -> Error {
        Error::Damaged {
            path: self.path.clone(),
            reason: reason.into(),
        }
    }

    /// Whether it is what it should be, as it is now.
    pub fn is(&self, size: u64, sha256: &str) -> bool {
        self.written == size && hex::encode(self.hasher.clone().finalize()) == sha256
    }

    /// Gives the file its name, if it is what it should be; an older one stays until then.
    pub fn finish(self, size: u64, sha256: &str) -> Result<PathBuf> {
        if self.written != size {
            return Err(self.damaged(format!("{} of {size} bytes arrived", self.written)));
        }
        let found = hex::encode(self.hasher.clone().finalize());
        if found != sha256 {
            return Err(self.damaged(format!("SHA-256 is {found}, not {sha256}")));
        }
        self.file.as_file().sync_all().map_err(Error::io(&self.path))?;
        match self.file.persist(&self.path) {
            Ok(_) => Ok(self.path),
            Err(error) => Err(Error::io(&self.path)(error.error)),
        }
    }
}

/// Length of an artifact in bytes.
pub fn size(artifact: &Artifact) -> u64 {
    u64::try_from(artifact.size_bytes).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ABC: &str = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

    fn entries(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn a_whole_file_gets_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        std::fs::write(&path, "older").unwrap();
        let mut file = Destination::new(&path).unwrap();
        file.write(b"a").unwrap();
        file.write(b"bc").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"older");
        file.finish(3, ABC).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"abc");
        assert_eq!(entries(folder.path()), 1);
    }

    #[test]
    fn a_damaged_one_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let mut file = Destination::new(&path).unwrap();
        file.write(b"abd").unwrap();
        assert!(file.finish(3, ABC).unwrap_err().to_string().contains("SHA-256"));
        let mut file = Destination::new(&path).unwrap();
        file.write(b"ab").unwrap();
        assert!(file.finish(3, ABC).unwrap_err().to_string().contains("2 of 3 bytes"));
        assert_eq!(entries(folder.path()), 0);
    }

    #[test]
    fn what_can_not_be_written_is_known_before() {
        let folder = tempfile::tempdir().unwrap();
        Destination::check(&folder.path().join("out")).unwrap();
        assert_eq!(entries(folder.path()), 0);
        assert!(Destination::check(folder.path()).is_err());
        assert!(Destination::check(Path::new("-")).is_err());
        let missing = Destination::check(&folder.path().join("missing/out"));
        let told = missing.unwrap_err().to_string();
        assert!(
            told.contains("missing/out: there is no folder") && !told.contains(".part"),
            "{told}"
        );
    }
}
