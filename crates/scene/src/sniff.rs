//! Which format a file is of, told by its first bytes and never by its name.
use crate::container::Format;
use crate::error::bad;
use crate::ignored::BadRows;
use crate::summary::Summary;
use crate::{Error, Result, gltf, ksplat, ply, sog, splat, spz};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// So many first bytes are enough to tell all formats apart: the longest header of a PLY.
pub const HEAD: usize = ply::header::MAX_HEADER as usize;

/// The format that first bytes announce; a `.splat` announces nothing.
pub(crate) fn announced(first: &[u8]) -> Option<Format> {
    match first {
        first if ply::begins(first) && has_packed_rows(first) => Some(Format::CompressedPly),
        first if ply::begins(first) => Some(Format::Ply),
        first if spz::is_spz(first) => Some(Format::Spz),
        first if sog::detect(first) => Some(Format::Sog),
        first if ksplat::detect(first) => Some(Format::Ksplat),
        first => gltf::announced(first),
    }
}

/// Whether the Gaussians in the header of a PLY have the property by which compressed ones are known.
fn has_packed_rows(first: &[u8]) -> bool {
    let mut vertex = false;
    for line in first.split(|byte| *byte == b'\n') {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"end_header") => return false,
            Some(b"element") => vertex = words.next() == Some(b"vertex"),
            Some(b"property") if vertex && words.next_back() == Some(b"packed_position") => return true,
            _ => (),
        }
    }
    false
}

/// The format of a file of `size` bytes that begins with `head`, or `None` where it looks like no scene.
///
/// [`HEAD`] bytes are enough. Damaged files are told by what they begin with too, so that the reader of their format
/// says what is wrong with them. A `.splat` is what remains: rows that look like Gaussians, as far as `head` goes.
pub fn sniff(head: &[u8], size: u64) -> Option<Format> {
    announced(head).or_else(|| splat::looks_like(head, size).then_some(Format::Splat))
}

/// Whether a folder holds the parts of a SOG that was not bundled, or one that is streamed: WebP pictures in it are
/// numbers, not views.
pub fn is_loose_sog(folder: &Path) -> bool {
    let has = |name: &str| folder.join(name).is_file();
    has("meta.json") && has("means_l.webp") || has(sog::INDEX)
}

/// Why what is no regular file holds no scene.
pub(crate) fn not_a_file(path: &Path) -> Error {
    let reason = if !path.is_dir() {
        "not a regular file"
    } else if is_loose_sog(path) {
        "a folder, where one file is asked for"
    } else {
        "a folder without the files of a SOG: meta.json and means_l.webp, or lod-meta.json"
    };
    bad(path, reason.to_string())
}

impl Format {
    /// The format of a file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::BadScene`] for what is no regular file, or in no format: with the reason, for which it
    /// may be read to its end.
    pub fn of(path: &Path) -> Result<Format> {
        let mut file = File::open(path).map_err(Error::io(path))?;
        let metadata = file.metadata().map_err(Error::io(path))?;
        if !metadata.is_file() {
            return Err(not_a_file(path));
        }
        let mut head = Vec::new();
        let mut start = (&mut file).take(HEAD as u64);
        start.read_to_end(&mut head).map_err(Error::io(path))?;
        if let Some(format) = sniff(&head, metadata.len()) {
            return Ok(format);
        }
        // What does not look like one at its beginning may still be one, and else is told why not.
        let mut source = BufReader::new(head.chain(file));
        splat::read(path, &mut source, metadata.len(), BadRows::Ignore).map(|_| Format::Splat)
    }
}

/// What `head` says, the first [`HEAD`](crate::HEAD) bytes of a file of `size` bytes, or all of a smaller one; `name` is for
/// messages. `None` where it says nothing: a SOG and a glTF have their figures anywhere.
///
/// # Errors
/// [`Error::BadScene`](crate::Error::BadScene) for what [`Scene::read_with`](crate::Scene::read_with) would refuse after
/// as many bytes, bad rows being ignored: not a scene, or one that is shorter than its header promises.
pub fn summary(name: &Path, head: &[u8], size: u64) -> Result<Option<Summary>> {
    let said = match head {
        _ if ply::begins(head) => ply::summary(head, size),
        _ if spz::is_spz(head) => spz::summary(head, size),
        _ if sog::detect(head) || gltf::announced(head).is_some() => return Ok(None),
        _ if ksplat::detect(head) => ksplat::summary(head, size),
        _ => splat::summary(head, size),
    };
    said.map(Some).map_err(|reason| bad(name, reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;

    const PLAIN: &[u8] =
        b"ply\nformat ascii 1.0\ncomment packed_position\nelement vertex 1\nproperty float x\nend_header\n";
    const PACKED: &[u8] =
        b"ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nproperty uint packed_position\r\nend_header\r\n";

    /// A row at (1, 2, 3) without a turn.
    fn row() -> Vec<u8> {
        let floats = [1.0f32, 2.0, 3.0, 0.1, 0.1, 0.1];
        let mut row: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
        row.extend([10, 20, 30, 255, 255, 128, 128, 128]);
        row
    }

    #[test]
    fn first_bytes_tell_the_format() {
        let gzip = b"\x1f\x8b\x08\x00";
        for (head, format) in [
            (PLAIN, Format::Ply),
            (PACKED, Format::CompressedPly),
            (
                b"ply\nelement vertex 1\nproperty\tuint\tpacked_position\nend_header\n",
                Format::CompressedPly,
            ),
            (
                b"ply\nelement face 1\nproperty uint packed_position\nelement vertex 1\nend_header\n",
                Format::Ply,
            ),
            (b"ply", Format::Ply),
            (gzip, Format::Spz),
            (b"NGSP\x04", Format::Spz),
            (b"PK\x03\x04", Format::Sog),
            (
                b"\0\x01\0\0\x01\0\0\0\x01\0\0\0\x07\0\0\0\x07\0\0\0\x02\0\0\0",
                Format::Ksplat,
            ),
            (b"glTF\x02\0\0\0", Format::Glb),
            (b" {\n\t\"asset\"", Format::Gltf),
            (b"\xef\xbb\xbf{\"scene\":0", Format::Gltf),
        ] {
            assert_eq!(sniff(head, 1000), Some(format), "{}", head.escape_ascii());
        }
        for head in [
            &b""[..],
            b"plywood",
            b"\x89PNG\r\n\x1a\n",
            b"Dear diary",
            b"{ brackets }",
            b"{\"\0\0",
            b"[{\"position\":",
        ] {
            assert_eq!(sniff(head, 1024), None, "{}", head.escape_ascii());
        }
    }

    #[test]
    fn real_scenes_are_told_by_their_first_bytes() {
        for (name, format) in [
            ("biker.compressed.ply", Format::CompressedPly),
            ("biker.spz", Format::Spz),
            ("donut.ply", Format::Ply),
            ("plant.splat", Format::Splat),
            ("pod.spz", Format::Spz),
        ] {
            let Some(path) = crate::testing::scene_path(name) else {
                return;
            };
            let bytes = std::fs::read(path).unwrap();
            assert_eq!(sniff(&bytes[..HEAD], bytes.len() as u64), Some(format), "{name}");
        }
    }

    #[test]
    fn loose_parts_of_a_sog_are_known() {
        let folder = tempfile::tempdir().unwrap();
        for (name, loose) in [("a.webp", false), ("meta.json", false), ("means_l.webp", true)] {
            std::fs::write(folder.path().join(name), "x").unwrap();
            assert_eq!(is_loose_sog(folder.path()), loose, "{name}");
        }
    }

    #[test]
    fn rows_of_gaussians_are_a_splat() {
        let rows = row().repeat(4000);
        let size = rows.len() as u64;
        assert_eq!(sniff(&rows[..HEAD], size), Some(Format::Splat));
        // The head may end within a row.
        assert_eq!(sniff(&rows[..50], size), Some(Format::Splat));
        assert_eq!(sniff(&rows[..HEAD], size + 1), None);
        assert_eq!(sniff(&rows[..31], size), None);
        assert_eq!(sniff(&rows[1..HEAD], size), None, "rows that begin elsewhere");
        assert_eq!(sniff(&[0; 64], 64), None);
    }

    #[test]
    fn files_are_looked_into() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let of = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            Format::of(&path)
        };
        assert_eq!(of(PACKED).unwrap(), Format::CompressedPly);
        assert_eq!(of(&row()).unwrap(), Format::Splat);
        // Rows without a rotation fill the head, and still are less than half.
        let late = [vec![0; HEAD], row().repeat(3000)].concat();
        assert_eq!(sniff(&late[..HEAD], late.len() as u64), None);
        assert_eq!(of(&late).unwrap(), Format::Splat);
        let reason = |bytes: &[u8]| of(bytes).unwrap_err().to_string();
        for bytes in [&b""[..], b"Dear diary", &[0; 320], &late[..late.len() - 1]] {
            let expected = Scene::parse(&path, bytes).unwrap_err().to_string();
            assert_eq!(reason(bytes), expected);
        }
        assert!(reason(b"Dear diary").contains("photo.png: not a scene: neither a PLY"));
        let of_folder = Format::of(folder.path()).unwrap_err().to_string();
        assert!(of_folder.contains("a folder without the files of a SOG"), "{of_folder}");
        assert!(matches!(Format::of(&folder.path().join("none")), Err(Error::Io { .. })));
    }
}
