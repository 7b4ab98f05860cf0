//! What formats and their files are called.
use crate::container::Format;
use std::path::Path;

impl Format {
    /// All of them.
    pub const ALL: [Format; 8] = [
        Format::Ply,
        Format::CompressedPly,
        Format::Spz,
        Format::Splat,
        Format::Ksplat,
        Format::Sog,
        Format::Gltf,
        Format::Glb,
    ];

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Format::Ply => "PLY",
            Format::CompressedPly => "compressed PLY",
            Format::Spz => "SPZ",
            Format::Splat => ".splat",
            Format::Ksplat => ".ksplat",
            Format::Sog => "SOG",
            Format::Gltf => "glTF",
            Format::Glb => "binary glTF",
        }
    }

    /// The format that a file's name says it is of, if any. A compressed PLY is one, whatever comes before `.ply`.
    pub fn of_name(path: &Path) -> Option<Format> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Format::ALL.into_iter().find(|format| format.extension() == extension)
    }

    /// The format that a file's whole name says: of a PLY also whether it is a compressed one.
    pub fn of_whole_name(path: &Path) -> Option<Format> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let compressed = format!(".{}", Format::CompressedPly.extension());
        match Format::of_name(path)? {
            Format::Ply if name.ends_with(&compressed) => Some(Format::CompressedPly),
            format => Some(format),
        }
    }

    /// Whether a file of this format may be called so: with any name but one that says it is of another. Both kinds
    /// of PLY may have the name of either.
    ///
    /// # Errors
    /// Says which format the name stands for, and which name would do.
    pub fn check_name(self, path: &Path) -> Result<(), String> {
        let plain = |format| match format {
            Format::CompressedPly => Format::Ply,
            other => other,
        };
        match Format::of_name(path) {
            Some(other) if other != plain(self) => Err(format!(
                "{} would pass for {}, but a marked scene is in the format it was read from, {}: name it *.{}",
                path.display(),
                other.name(),
                self.name(),
                self.extension()
            )),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_formats() {
        for format in Format::ALL {
            let name = format!("a.b.{}", format.extension());
            let said = Format::of_name(Path::new(&name)).unwrap();
            let expected = match format {
                Format::CompressedPly => Format::Ply,
                other => other,
            };
            assert_eq!(said, expected);
            assert_eq!(Format::of_whole_name(Path::new(&name)), Some(format));
            format.check_name(Path::new(&name)).unwrap();
            format.check_name(Path::new(&name.to_uppercase())).unwrap();
        }
        for name in ["scene", "spz", ".ply", "a.zip", "a.spz.part", ""] {
            assert_eq!(Format::of_name(Path::new(name)), None, "{name}");
        }
    }

    #[test]
    fn only_the_name_of_another_format_is_refused() {
        let check = |format: Format, name: &str| format.check_name(Path::new(name));
        for name in ["out.ply", "out.compressed.ply", "out", "out.bin"] {
            check(Format::Ply, name).unwrap();
            check(Format::CompressedPly, name).unwrap();
        }
        for format in Format::ALL {
            for other in Format::ALL {
                let name = format!("out.{}", other.extension());
                let both = [Format::Ply, Format::CompressedPly];
                let same = format == other || both.contains(&format) && both.contains(&other);
                assert_eq!(check(format, &name).is_ok(), same, "{format:?} as {name}");
            }
        }
        assert_eq!(
            check(Format::Spz, "to/marked.PLY").unwrap_err(),
            "to/marked.PLY would pass for PLY, but a marked scene is in the format it was read from, SPZ: name it *.spz"
        );
    }
}
