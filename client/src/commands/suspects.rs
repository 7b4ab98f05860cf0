//! What is handed in: files and folders to be sent, and artifacts that are there already.
use std::path::{Path, PathBuf};

use crate::context::Context;
use crate::error::{Error, Result};
use crate::names;
use crate::transfer::{Source, discard, upload};

/// Most pictures of one job; the server takes no more.
const MOST: usize = 1000;
/// Pictures that the service reads.
const PICTURES: [&str; 4] = ["png", "jpg", "jpeg", "webp"];

/// One thing that is handed in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// It is there already.
    Artifact(String),
    /// It is to be sent.
    File(PathBuf),
}

impl Input {
    /// A scene, whatever its file is called.
    pub fn scene(text: &str) -> Self {
        match names::artifact_or_file(text) {
            Some(name) => Self::Artifact(name),
            None => Self::File(text.into()),
        }
    }
}

/// What became of the inputs.
#[derive(Debug, Default)]
pub struct Inputs {
    /// All of them, in order.
    pub names: Vec<String>,
    /// Those of them that were sent.
    pub sent: Vec<String>,
    /// What people may call them all.
    pub title: String,
}

/// Sends what is not there yet; what was sent is deleted again when something fails.
pub async fn send(context: &Context, inputs: &[Input]) -> Result<Inputs> {
    let mut sources = Vec::new();
    for input in inputs {
        sources.push(match input {
            Input::Artifact(_) => None,
            Input::File(path) => Some(Source::hash(path).await?),
        });
    }
    let mut known = Inputs::default();
    let total = sources.iter().flatten().map(|source| source.size).sum();
    let mut before = 0;
    for (input, source) in inputs.iter().zip(&sources) {
        let name = match (input, source) {
            (Input::Artifact(name), _) => name.clone(),
            // Every file was hashed above.
            (Input::File(_), None) => continue,
            (Input::File(_), Some(source)) => match upload(context, source, before, total).await {
                Ok(artifact) => {
                    before += source.size;
                    known.sent.push(artifact.name.clone());
                    artifact.name
                }
                Err(error) => {
                    discard(context, &known.sent).await;
                    return Err(error);
                }
            },
        };
        known.names.push(name);
    }
    known.title = sources
        .iter()
        .flatten()
        .next()
        .map(|s| s.display_name.clone())
        .unwrap_or_default();
    context.console.clear();
    Ok(known)
}

/// What the paths of `verify` name: one scene, or pictures and folders of them.
pub fn find(paths: &[String]) -> Result<Vec<Input>> {
    let mut found = Vec::new();
    for text in paths {
        let path = match Input::scene(text) {
            Input::File(path) => path,
            artifact => {
                found.push(artifact);
                continue;
            }
        };
        let metadata = std::fs::metadata(&path).map_err(Error::io(&path))?;
        if metadata.is_dir() {
            found.extend(folder(&path)?.into_iter().map(Input::File));
        } else if has(&path, &["ply"]) {
            if paths.len() > 1 {
                return Err(bad(&path, "a scene is read on its own: give one scene, or pictures"));
            }
            found.push(Input::File(path));
        } else if has(&path, &PICTURES) {
            found.push(Input::File(path));
        } else {
            return Err(bad(&path, "neither a scene (ply) nor a picture (png, jpg, webp)"));
        }
    }
    if found.len() > MOST {
        return Err(Error::BadOption {
            field: "PATH",
            reason: format!("{} pictures, but at most {MOST} are read at once", found.len()),
        });
    }
    Ok(found)
}

/// The pictures of a folder, by name; it may hold other things too.
fn folder(path: &Path) -> Result<Vec<PathBuf>> {
    let mut pictures = Vec::new();
    for entry in std::fs::read_dir(path).map_err(Error::io(path))? {
        let file = entry.map_err(Error::io(path))?.path();
        if file.is_file() && has(&file, &PICTURES) {
            pictures.push(file);
        }
    }
    if pictures.is_empty() {
        return Err(bad(path, "a folder without png, jpg or webp pictures"));
    }
    pictures.sort();
    Ok(pictures)
}

fn has(path: &Path, extensions: &[&str]) -> bool {
    path.extension()
        .is_some_and(|found| extensions.iter().any(|e| found.eq_ignore_ascii_case(e)))
}

fn bad(path: &Path, reason: &str) -> Error {
    Error::io(path)(std::io::Error::other(reason))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(path: PathBuf) -> String {
        path.to_str().unwrap().to_owned()
    }

    #[test]
    fn folders_give_their_pictures_in_order() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.PNG", "a.jpg", "cameras.json", "c.webp"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let found = find(&[text(folder.path().into())]).unwrap();
        let expected = ["a.jpg", "b.PNG", "c.webp"].map(|n| Input::File(folder.path().join(n)));
        assert_eq!(found, expected);
    }

    #[test]
    fn a_scene_stands_alone() {
        let folder = tempfile::tempdir().unwrap();
        let (scene, picture) = (folder.path().join("a.ply"), folder.path().join("a.png"));
        std::fs::write(&scene, "x").unwrap();
        std::fs::write(&picture, "x").unwrap();
        assert_eq!(find(&[text(scene.clone())]).unwrap(), [Input::File(scene.clone())]);
        let both = find(&[text(picture), text(scene)]).unwrap_err().to_string();
        assert!(both.contains("on its own"), "{both}");
    }

    #[test]
    fn what_can_not_be_read_is_told_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let empty = find(&[text(folder.path().into())]).unwrap_err().to_string();
        assert!(empty.contains("a folder without"), "{empty}");
        let notes = folder.path().join("notes.txt");
        std::fs::write(&notes, "x").unwrap();
        assert!(
            find(&[text(notes)])
                .unwrap_err()
                .to_string()
                .contains("notes.txt: neither")
        );
        let missing = find(&[text(folder.path().join("missing.png"))])
            .unwrap_err()
            .to_string();
        assert!(missing.contains("missing.png"), "{missing}");
    }

    #[test]
    fn artifacts_are_taken_as_they_are() {
        let name = "artifacts/0190a5d0-1111-7abc-8def-000000000001".to_owned();
        assert_eq!(find(std::slice::from_ref(&name)).unwrap(), [Input::Artifact(name)]);
    }
}
