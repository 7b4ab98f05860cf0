//! The file of a scene: one that credentials can be of, its hash, and its media type.
use std::fs::File;
use std::path::Path;

use base64::Engine as _;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use sha2::{Digest as _, Sha256};

use crate::error::{Error, Result};

/// What manifests call the format of scenes that have no media type of their own, and of all others, too: the library has
/// handlers for some types, which would look into the file.
pub const MEDIA_TYPE: &str = "application/octet-stream";

/// Opens a scene, which must be one file: what lies in others would not be signed.
pub fn open(path: &Path) -> Result<File> {
    if path.is_dir() {
        return Err(Error::file(
            path,
            "credentials are of one file, and this is a folder; convert the scene to .sog",
        ));
    }
    if path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("gltf"))
    {
        return Err(Error::file(
            path,
            "credentials are of one file, and a .gltf may have its data in others; convert the scene to .glb",
        ));
    }
    File::open(path).map_err(Error::io(path))
}

/// The name of a file for people.
pub fn title(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// The SHA-256 of a file as a URI (RFC 6920): `ni:///sha-256;…`.
pub fn name_by_hash(path: &Path) -> Result<String> {
    let mut hasher = Sha256::new();
    std::io::copy(&mut open(path)?, &mut Writer(&mut hasher)).map_err(Error::io(path))?;
    Ok(format!(
        "ni:///sha-256;{}",
        BASE64_URL_SAFE_NO_PAD.encode(hasher.finalize())
    ))
}

struct Writer<'a>(&'a mut Sha256);

impl std::io::Write for Writer<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hash_is_told_as_rfc_6920_does() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("hello.ply");
        std::fs::write(&path, "Hello World!").unwrap();
        // The example of the RFC's section 8.1.
        assert_eq!(
            name_by_hash(&path).unwrap(),
            "ni:///sha-256;f4OxZX_x_FO5LcGBSKHWXfwtSx-j1ncoSt3SABJtkGk"
        );
        assert_eq!(title(&path), "hello.ply");
    }

    #[test]
    fn scenes_in_several_files_are_refused() {
        let folder = tempfile::TempDir::new().unwrap();
        assert!(
            open(folder.path())
                .unwrap_err()
                .to_string()
                .contains("convert the scene to .sog")
        );
        let gltf = folder.path().join("a.GLTF");
        std::fs::write(&gltf, "{}").unwrap();
        assert!(
            open(&gltf)
                .unwrap_err()
                .to_string()
                .contains("convert the scene to .glb")
        );
    }
}
