//! What is handed in: files and folders to be sent, and artifacts that are there already.
use std::path::{Path, PathBuf};

use crate::context::Context;
use crate::error::{Error, Result};
use crate::file_kind::FileKind;
use crate::resource_names;
use crate::transfer::{Source, discard, upload};

/// Most files of one job; the server takes no more.
const MOST: usize = 1000;
/// Names of pictures in folders.
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
    /// A scene, or cameras, whatever the file is called.
    pub fn scene(text: &str) -> Self {
        match resource_names::artifact_or_file(text) {
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

/// What the paths of `verify` name: scenes, pictures and folders of them. Files are what their content says; in
/// folders, which may hold other things too, names say which are pictures.
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
        if path.is_dir() {
            found.extend(folder(&path)?.into_iter().map(Input::File));
            continue;
        }
        // What is neither a scene nor a picture is better known before it is sent.
        FileKind::of(&path)?;
        found.push(Input::File(path));
    }
    if found.len() > MOST {
        return Err(Error::BadOption {
            field: "PATH",
            reason: format!("{} files, but at most {MOST} are read at once", found.len()),
        });
    }
    Ok(found)
}

/// The pictures of a folder, by name.
fn folder(path: &Path) -> Result<Vec<PathBuf>> {
    if guardsplat_scene::is_loose_sog(path) {
        return Err(bad(
            path,
            "the parts of an SOG scene, whose pictures are no views; bundle them into one .sog file first",
        ));
    }
    let mut pictures = Vec::new();
    for entry in std::fs::read_dir(path).map_err(Error::io(path))? {
        let file = entry.map_err(Error::io(path))?.path();
        if file.is_file() && is_picture(&file) {
            pictures.push(file);
        }
    }
    if pictures.is_empty() {
        return Err(bad(path, "a folder without png, jpg or webp pictures"));
    }
    pictures.sort();
    Ok(pictures)
}

fn is_picture(path: &Path) -> bool {
    path.extension()
        .is_some_and(|found| PICTURES.iter().any(|e| found.eq_ignore_ascii_case(e)))
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
        for name in ["meta.json", "means_l.webp"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let told = find(&[text(folder.path().into())]).unwrap_err().to_string();
        assert!(told.contains("no views"), "{told}");
    }

    #[test]
    fn scenes_and_pictures_go_together() {
        let folder = tempfile::tempdir().unwrap();
        let (scene, picture) = (folder.path().join("a"), folder.path().join("b"));
        std::fs::write(&scene, "ply\n").unwrap();
        std::fs::write(&picture, b"\x89PNG\r\n\x1a\n").unwrap();
        assert_eq!(find(&[text(scene.clone())]).unwrap(), [Input::File(scene.clone())]);
        let both = find(&[text(picture.clone()), text(scene.clone())]).unwrap();
        assert_eq!(both, [Input::File(picture), Input::File(scene)]);
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
                .contains("notes.txt: not a PNG")
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
