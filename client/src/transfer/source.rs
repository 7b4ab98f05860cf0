//! Files to be sent, hashed first.
use std::path::{Path, PathBuf};
use std::time::Duration;

use guardsplat_proto::v1::UploadMetadata;
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::AsyncReadExt;

use crate::error::{Error, Result};

/// Bytes that are read, hashed and sent at a time.
pub const CHUNK: usize = 256 * 1024;
/// Chunks read ahead of the network.
pub const AHEAD: usize = 4;
/// Between two looks at how far it is.
pub const LOOK: Duration = Duration::from_millis(200);
/// Longest display name of an artifact, in bytes.
const LONGEST_NAME: usize = 255;

/// A file as it was when it was hashed.
#[derive(Clone, Debug)]
pub struct Source {
    /// Where it is.
    pub path: PathBuf,
    /// Its name without folders.
    pub display_name: String,
    /// Its length.
    pub size: u64,
    /// Its SHA-256 in hexadecimal.
    pub sha256: String,
}

impl Source {
    /// Reads a file once, to know what will be sent.
    pub async fn hash(path: &Path) -> Result<Self> {
        let mut file = File::open(path).await.map_err(Error::io(path))?;
        let metadata = file.metadata().await.map_err(Error::io(path))?;
        if !metadata.is_file() {
            return Err(Error::io(path)(std::io::Error::other("not a file")));
        }
        let mut hasher = Sha256::new();
        let mut size = 0;
        let mut buffer = vec![0; CHUNK];
        loop {
            let read = file.read(&mut buffer).await.map_err(Error::io(path))?;
            if read == 0 {
                break;
            }
            hasher.update(&buffer[..read]);
            size += read as u64;
        }
        if size == 0 {
            return Err(Error::io(path)(std::io::Error::other("an empty file")));
        }
        Ok(Self {
            path: path.to_owned(),
            display_name: display_name(path),
            size,
            sha256: hex::encode(hasher.finalize()),
        })
    }

    /// What is announced of it.
    pub fn metadata(&self) -> UploadMetadata {
        UploadMetadata {
            display_name: self.display_name.clone(),
            // No file is longer than this.
            size_bytes: i64::try_from(self.size).unwrap_or(i64::MAX),
            sha256: self.sha256.clone(),
        }
    }
}

/// A file's name without folders, cut to what the server takes.
fn display_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut text = String::new();
    for c in name.chars().map(|c| if c.is_control() { '_' } else { c }) {
        if text.len() + c.len_utf8() > LONGEST_NAME {
            break;
        }
        text.push(c);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lose_folders_and_are_cut_between_letters() {
        assert_eq!(display_name(Path::new("/a/b/scene.ply")), "scene.ply");
        assert_eq!(display_name(Path::new("a\nb.ply")), "a_b.ply");
        let long = display_name(Path::new(&"é".repeat(200)));
        assert_eq!(long.len(), 254);
        assert_eq!(display_name(Path::new("..")), "");
    }

    #[tokio::test]
    async fn length_and_hash_are_those_of_the_bytes() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"abc").unwrap();
        let source = Source::hash(file.path()).await.unwrap();
        assert_eq!(source.size, 3);
        assert_eq!(
            source.sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }

    #[tokio::test]
    async fn folders_and_missing_files_are_told_by_name() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Source::hash(folder.path()).await.is_err());
        let empty = folder.path().join("empty.ply");
        std::fs::write(&empty, "").unwrap();
        assert!(
            Source::hash(&empty)
                .await
                .unwrap_err()
                .to_string()
                .contains("an empty file")
        );
        let missing = folder.path().join("missing.ply");
        assert!(
            Source::hash(&missing)
                .await
                .unwrap_err()
                .to_string()
                .contains("missing.ply")
        );
    }
}
