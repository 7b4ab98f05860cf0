//! What there is to read on disk: one scene, or picture files and folders of them.
use std::path::{Path, PathBuf};

use super::kind::Kind;
use crate::error::{Error, Result};
use crate::quality::PictureFormat;
use crate::scene::is_loose_sog;

/// Most pictures of one reading.
pub const MAX_PICTURES: usize = 10_000;

/// What paths name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scene file, of any format.
    Scene(PathBuf),
    /// Picture files, those of a folder by name.
    Pictures(Vec<PathBuf>),
}

/// Sorts out `paths`: a single scene of any format, or any number of pictures and folders of pictures. Files are what
/// their content says; in folders, which may hold other things too, names say which are pictures.
///
/// # Errors
/// A path that is not there, several scenes or scenes among pictures, a folder without pictures, a file of another
/// kind, or more than [`MAX_PICTURES`].
pub fn find_source(paths: &[PathBuf]) -> Result<Source> {
    let mut pictures = Vec::new();
    for path in paths {
        if path.is_dir() {
            add_folder(path, &mut pictures)?;
            continue;
        }
        match Kind::of(path)? {
            Kind::Scene if paths.len() == 1 => return Ok(Source::Scene(path.clone())),
            Kind::Scene => return Err(bad(path, "a scene is read on its own: give one scene, or pictures")),
            Kind::Picture => pictures.push(path.clone()),
        }
        check_count(pictures.len())?;
    }
    if pictures.is_empty() {
        return Err(Error::BadOption {
            field: "PATH",
            reason: "give a scene or pictures".into(),
        });
    }
    Ok(Source::Pictures(pictures))
}

/// Adds the pictures of a folder by name.
fn add_folder(path: &Path, pictures: &mut Vec<PathBuf>) -> Result<()> {
    if is_loose_sog(path) {
        return Err(bad(
            path,
            "the parts of an SOG scene, whose pictures are no views; bundle them into one .sog file first",
        ));
    }
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
        reason: format!("more than {MAX_PICTURES} pictures"),
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
    fn folders_give_their_pictures_by_name_and_scenes_stand_alone() {
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
        assert_eq!(
            find_source(std::slice::from_ref(&folder_path)).unwrap(),
            Source::Pictures(vec![a.clone(), b.clone(), c.clone()])
        );
        assert_eq!(
            find_source(&[c.clone(), picture.clone()]).unwrap(),
            Source::Pictures(vec![c.clone(), picture])
        );
        assert_eq!(
            find_source(std::slice::from_ref(&scene)).unwrap(),
            Source::Scene(scene.clone())
        );
        let reason = |paths: &[PathBuf]| find_source(paths).unwrap_err().to_string();
        assert!(reason(&[scene.clone(), scene.clone()]).contains("on its own"));
        assert!(reason(&[c.clone(), scene.clone()]).contains("on its own"));
        assert!(reason(&[folder_path.clone(), scene]).contains("on its own"));
        assert!(reason(&[c, text]).contains("not a scene"));
        assert!(reason(&[a]).contains("a.JPG: not a PNG"));
        assert!(reason(&[]).contains("give a scene"));
        assert!(reason(&[folder_path.join("none.png")]).contains("none.png"));
        let empty = tempfile::tempdir().unwrap();
        assert!(reason(&[empty.path().into()]).contains("without png"));
        at("meta.json", b"{}");
        at("means_l.webp", png);
        assert!(reason(&[folder_path]).contains("no views"));
    }
}
