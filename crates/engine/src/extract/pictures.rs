//! What there is to read on disk: scenes, picture files and folders of them.
use std::path::{Path, PathBuf};

use super::suspect_kind::SuspectKind;
use crate::error::{Error, Result};
use crate::quality::PictureFormat;
use crate::scene::is_loose_sog;

/// Most pictures of one reading.
pub const MAX_PICTURES: usize = 10_000;

/// What paths name: all of it is one suspect.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// Scene files, of any format, and folders of SOG.
    pub scenes: Vec<PathBuf>,
    /// Picture files, those of a folder by name.
    pub pictures: Vec<PathBuf>,
}

/// Sorts out `paths`: scenes of any format, be it the folder of a SOG, pictures and folders of pictures, any number of each. Files are what their content
/// says; in folders, which may hold other things too, names say which are pictures.
///
/// # Errors
/// No paths, a path that is not there, a folder without pictures, a file of another kind, or more than [`MAX_PICTURES`].
pub fn find_source(paths: &[PathBuf]) -> Result<Source> {
    let mut source = Source::default();
    for path in paths {
        if is_loose_sog(path) {
            source.scenes.push(path.clone());
        } else if path.is_dir() {
            add_folder(path, &mut source.pictures)?;
        } else {
            match SuspectKind::of(path)? {
                SuspectKind::Scene => source.scenes.push(path.clone()),
                SuspectKind::Picture => source.pictures.push(path.clone()),
            }
        }
        check_count(source.scenes.len() + source.pictures.len())?;
    }
    if source == Source::default() {
        return Err(Error::BadOption {
            field: "PATH",
            reason: "give scenes or pictures".into(),
        });
    }
    Ok(source)
}

/// Adds the pictures of a folder by name.
fn add_folder(path: &Path, pictures: &mut Vec<PathBuf>) -> Result<()> {
    let before = pictures.len();
    for entry in std::fs::read_dir(path).map_err(Error::io(path))? {
        let file = entry.map_err(Error::io(path))?.path();
        if file.is_file() && is_picture(&file) {
            pictures.push(file);
        }
        check_count(pictures.len())?;
    }
    if pictures.len() == before {
        return Err(bad(path, "a folder without png, jpg, webp or exr pictures"));
    }
    pictures[before..].sort();
    Ok(())
}

fn is_picture(path: &Path) -> bool {
    PictureFormat::of(path).is_ok()
}

fn check_count(count: usize) -> Result<()> {
    if count <= MAX_PICTURES {
        return Ok(());
    }
    Err(Error::BadOption {
        field: "PATH",
        reason: format!("more than {MAX_PICTURES} files"),
    })
}

fn bad(path: &Path, reason: &str) -> Error {
    Error::BadPicture {
        path: path.into(),
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_give_their_pictures_by_name_and_files_are_what_they_hold() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let png = b"\x89PNG\r\n\x1a\n";
        let (b, a, c) = (at("b.png", png), at("a.JPG", b"damaged"), at("c.webp", png));
        let (text, scene, picture) = (at("cameras.json", b"[]"), at("s", b"ply\n"), at("p", png));
        let folder_path = folder.path().to_path_buf();
        let pictures = |pictures: Vec<PathBuf>| Source {
            scenes: Vec::new(),
            pictures,
        };
        assert_eq!(
            find_source(std::slice::from_ref(&folder_path)).unwrap(),
            pictures(vec![a.clone(), b.clone(), c.clone()])
        );
        assert_eq!(
            find_source(&[c.clone(), picture.clone()]).unwrap(),
            pictures(vec![c.clone(), picture.clone()])
        );
        let mixed = find_source(&[scene.clone(), picture.clone(), scene.clone()]).unwrap();
        assert_eq!(mixed.scenes, [scene.clone(), scene]);
        assert_eq!(mixed.pictures, [picture]);
        let reason = |paths: &[PathBuf]| find_source(paths).unwrap_err().to_string();
        assert!(reason(&[c, text]).contains("not a scene"));
        assert!(reason(&[a]).contains("a.JPG: not a PNG"));
        assert!(reason(&[]).contains("give scenes"));
        assert!(reason(&[folder_path.join("none.png")]).contains("none.png"));
        let empty = tempfile::tempdir().unwrap();
        assert!(reason(&[empty.path().into()]).contains("without png"));
        at("meta.json", b"{}");
        at("means_l.webp", png);
        // Its pictures are no views, but numbers.
        let sog = find_source(std::slice::from_ref(&folder_path)).unwrap();
        assert_eq!((sog.scenes, sog.pictures), (vec![folder_path], Vec::new()));
    }
}
