//! Scene or picture? Told by what a file holds, whatever it is called: artifacts of the service have no names.
use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};
use crate::quality::is_picture;
use crate::scene::{Format, HEAD, sniff};

/// What can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SuspectKind {
    /// A scene, be it a damaged one.
    Scene,
    /// A picture, be it a damaged one.
    Picture,
}

impl SuspectKind {
    /// What a file is.
    ///
    /// # Errors
    /// [`Error::Io`], and [`Error::BadPicture`] for what is neither, with the reasons.
    pub fn of(path: &Path) -> Result<SuspectKind> {
        // Before it is opened: a pipe would wait for its other end.
        let size = match std::fs::metadata(path).map_err(Error::io(path))? {
            metadata if metadata.is_file() => metadata.len(),
            _ => return Err(Error::io(path)(std::io::Error::other("not a regular file"))),
        };
        let mut head = Vec::new();
        let file = File::open(path).map_err(Error::io(path))?;
        file.take(HEAD as u64).read_to_end(&mut head).map_err(Error::io(path))?;
        if is_picture(&head) {
            return Ok(SuspectKind::Picture);
        }
        if sniff(&head, size).is_some() {
            return Ok(SuspectKind::Scene);
        }
        match Format::of(path) {
            Ok(_) => Ok(SuspectKind::Scene),
            Err(crate::scene::Error::BadScene { path, reason }) => Err(Error::BadPicture {
                path,
                reason: format!("not a PNG, JPEG, WebP or OpenEXR picture, and {reason}"),
            }),
            Err(error) => Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_decides_and_names_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let kind = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            SuspectKind::of(&path)
        };
        for bytes in [
            &b"\x89PNG\r\n\x1a\n"[..],
            b"\xff\xd8\xff\xe0",
            b"RIFF\0\0\0\0WEBPVP8 ",
            b"\x76\x2f\x31\x01",
        ] {
            // As long as two rows of a .splat.
            let bytes = [bytes, &[0; 64][bytes.len()..]].concat();
            assert_eq!(
                kind("a.ply", &bytes).unwrap(),
                SuspectKind::Picture,
                "{}",
                bytes.escape_ascii()
            );
        }
        for bytes in [&b"ply\nformat"[..], b"\x1f\x8b\x08", b"NGSP"] {
            assert_eq!(
                kind("a.png", bytes).unwrap(),
                SuspectKind::Scene,
                "{}",
                bytes.escape_ascii()
            );
        }
        let reason = |name: &str, bytes: &[u8]| kind(name, bytes).unwrap_err().to_string();
        let told = reason("a.splat", b"Dear diary");
        assert!(
            told.contains("a.splat: not a PNG") && told.contains("and not a scene: neither a PLY"),
            "{told}"
        );
        assert!(reason("a.png", b"").contains("it is empty"));
        // A picture, and none that is read.
        assert!(reason("a.gif", b"GIF89a").contains("not a PNG"));
        assert!(matches!(
            SuspectKind::of(&folder.path().join("none")),
            Err(Error::Io { .. })
        ));
        assert!(
            SuspectKind::of(folder.path())
                .unwrap_err()
                .to_string()
                .contains("not a regular file")
        );
    }
}
