//! Scene or picture? Told by what a file holds, before it is sent to a worker that would say the same.
use std::fs::File;
use std::io::Read;
use std::path::Path;

use guardsplat_scene::{Error as SceneError, Format};

use crate::error::{Error, Result};

/// Longest beginning by which a picture is known.
const HEAD: u64 = 12;

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A scene of this format, be it a damaged one.
    Scene(Format),
    /// A picture, be it a damaged one.
    Picture,
}

impl FileKind {
    /// What the file is; fails where it is neither, with the reasons.
    pub fn of(path: &Path) -> Result<Self> {
        let bad = |reason: String| Error::io(path)(std::io::Error::other(reason));
        // Before it is opened: a pipe would wait for its other end.
        if !std::fs::metadata(path).map_err(Error::io(path))?.is_file() {
            return Err(bad("not a file".into()));
        }
        let mut head = Vec::new();
        let file = File::open(path).map_err(Error::io(path))?;
        file.take(HEAD).read_to_end(&mut head).map_err(Error::io(path))?;
        if is_picture(&head) {
            return Ok(Self::Picture);
        }
        match Format::of(path) {
            Ok(format) => Ok(Self::Scene(format)),
            Err(SceneError::BadScene { reason, .. }) => {
                Err(bad(format!("not a PNG, JPEG or WebP picture, and {reason}")))
            }
            Err(SceneError::Io { source, .. }) => Err(Error::io(path)(source)),
            // Of a file that is not read, but looked at.
            Err(error @ SceneError::DoesNotFit { .. }) => Err(bad(error.to_string())),
        }
    }
}

/// Whether a file that begins so is a picture that the service reads.
fn is_picture(head: &[u8]) -> bool {
    let webp = head.starts_with(b"RIFF") && head.get(8..12) == Some(b"WEBP");
    webp || head.starts_with(b"\x89PNG\r\n\x1a\n") || head.starts_with(b"\xff\xd8\xff")
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
            FileKind::of(&path)
        };
        for bytes in [
            &b"\x89PNG\r\n\x1a\nIHDR"[..],
            b"\xff\xd8\xff\xe0",
            b"RIFF\0\0\0\0WEBPVP8 ",
        ] {
            assert_eq!(
                kind("a.ply", bytes).unwrap(),
                FileKind::Picture,
                "{}",
                bytes.escape_ascii()
            );
        }
        for (bytes, format) in [(&b"ply\n"[..], Format::Ply), (b"\x1f\x8b", Format::Spz)] {
            assert_eq!(kind("a.png", bytes).unwrap(), FileKind::Scene(format));
        }
        let reason = |name: &str, bytes: &[u8]| kind(name, bytes).unwrap_err().to_string();
        for bytes in [&b""[..], b"Dear diary", b"RIFF\0\0\0\0WAVE", b"GIF89a"] {
            let told = reason("a.png", bytes);
            assert!(
                told.contains("a.png: not a PNG") && told.contains("and not a scene"),
                "{told}"
            );
        }
        assert!(
            FileKind::of(&folder.path().join("none.ply"))
                .unwrap_err()
                .to_string()
                .contains("none.ply")
        );
        assert!(
            FileKind::of(folder.path())
                .unwrap_err()
                .to_string()
                .contains("not a file")
        );
    }
}
