//! What there is to read on disk: one scene, or picture files and folders of them.
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::quality::PictureFormat;

/// Most pictures of one reading.
pub const MAX_PICTURES: usize = 10_000;

/// What paths name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scene file.
    Scene(PathBuf),
    /// Picture files, those of a folder by name.
    Pictures(Vec<PathBuf>),
}

/// Sorts out `paths`: a single scene (`.ply`), or any number of pictures and folders of pictures.
///
/// # Errors
/// A path that is not there, several scenes or scenes among pictures, a folder without pictures, a file of another
/// kind, or more than [`MAX_PICTURES`].
pub fn find_source(paths: &[PathBuf]) -> Result<Source> {
    if let [path] = paths
        && is_scene(path)
    {
        return Ok(Source::Scene(path.clone()));
    }
    let mut pictures = Vec::new();
    for path in paths {
        let metadata = std::fs::metadata(path).map_err(Error::io(path))?;
        if metadata.is_dir() {
            let before = pictures.len();
            let entries = std::fs::read_dir(path).map_err(Error::io(path))?;
            for entry in entries {
                let file = entry.map_err(Error::io(path))?.path();
                // A folder may hold other things too, such as the cameras.
                if file.is_file() && is_picture(&file) {
                    pictures.push(file);
                }
                check_count(pictures.len())?;
            }
            if pictures.len() == before {
                return Err(bad(path, "a folder without png, jpg, webp or exr pictures"));
            }
            pictures[before..].sort();
        } else if is_scene(path) {
            return Err(bad(path, "a scene is read on its own: give one scene, or pictures"));
        } else if is_picture(path) {
            pictures.push(path.clone());
            check_count(pictures.len())?;
        } else {
            return Err(bad(path, "neither a scene (ply) nor a picture (png, jpg, webp, exr)"));
        }
    }
    if pictures.is_empty() {
        return Err(Error::BadOption {
            field: "PATH",
            reason: "give a scene or pictures".into(),
        });
    }
    Ok(Source::Pictures(pictures))
}

fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"))
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
        let at = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "").unwrap();
            path
        };
        let (b, a, c) = (at("b.png"), at("a.JPG"), at("c.webp"));
        let (text, scene) = (at("cameras.json"), at("s.PLY"));
        let folder_path = folder.path().to_path_buf();
        assert_eq!(
            find_source(std::slice::from_ref(&folder_path)).unwrap(),
            Source::Pictures(vec![a, b.clone(), c.clone()])
        );
        assert_eq!(
            find_source(&[c.clone(), b.clone()]).unwrap(),
            Source::Pictures(vec![c.clone(), b])
        );
        assert_eq!(
            find_source(std::slice::from_ref(&scene)).unwrap(),
            Source::Scene(scene.clone())
        );
        let reason = |paths: &[PathBuf]| find_source(paths).unwrap_err().to_string();
        assert!(reason(&[scene.clone(), scene.clone()]).contains("on its own"));
        assert!(reason(&[c, scene]).contains("on its own"));
        assert!(reason(&[text]).contains("neither a scene"));
        assert!(reason(&[]).contains("give a scene"));
        assert!(reason(&[folder_path.join("none.png")]).contains("none.png"));
        let empty = tempfile::tempdir().unwrap();
        assert!(reason(&[empty.path().into()]).contains("without png"));
    }
}
