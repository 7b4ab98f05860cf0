//! Folders of `meta.json` and pictures: read as the bundle that they would be, and written as folders.
use super::*;
use crate::{BadRows, Format};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

/// A folder with the files of a bundle, and one that is no part of it.
fn folder(file: &File) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene");
    fs::create_dir(&path).unwrap();
    for (name, content) in unzip(&file.bytes()) {
        fs::write(path.join(name), content).unwrap();
    }
    fs::write(path.join("licence.txt"), "ours").unwrap();
    (folder, path)
}

/// Pictures have the names by which a folder is known.
fn file() -> File {
    let mut file = File::new(2, 2, 9);
    for (name, ..) in &mut file.pictures {
        if *name == "means_l" {
            *name = "means_l.webp";
        }
    }
    file.meta["means"]["files"][0] = "means_l.webp".into();
    file
}

fn contents(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(path).unwrap().map(|entry| entry.unwrap());
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

fn open(path: &Path, memory: u64) -> Result<Scene> {
    Scene::read_with_files(path, BadRows::Refuse, memory)
}

#[test]
fn a_folder_is_the_scene_of_its_bundle() {
    let file = file();
    let (_keep, path) = folder(&file);
    let scene = open(&path, u64::MAX).unwrap();
    assert_eq!(scene.gaussians, file.read().unwrap().gaussians);
    assert_eq!(
        (scene.format(), scene.is_one_file(), scene.learnable_degree()),
        (Format::Sog, false, 0)
    );
    let refused = Scene::read(&path).unwrap_err().to_string();
    assert!(refused.contains("a folder, where one file is asked for"), "{refused}");
}

#[test]
fn a_folder_is_written_with_one_picture_changed() {
    let (keep, path) = folder(&file());
    let scene = open(&path, u64::MAX).unwrap();
    let sh = changed(&scene, |_, value| value + 0.1);
    let out = keep.path().join("marked");
    scene.write(&out, &sh).unwrap();
    let (old, new) = (contents(&path), contents(&out));
    assert!(old.keys().eq(new.keys()));
    for (name, content) in &old {
        assert_eq!(content == &new[name], name != "sh0", "{name}");
    }
    assert_eq!(open(&out, u64::MAX).unwrap().gaussians.sh, sh);
    // A folder that is there is not written into, and nothing is left beside.
    assert!(scene.write(&out, &sh).is_err());
    assert!(contents(&out) == new);
    assert_eq!(fs::read_dir(keep.path()).unwrap().count(), 2);
    // As one file, where the name says so.
    let bundle = keep.path().join("marked.sog");
    scene.write(&bundle, &sh).unwrap();
    assert_eq!(Scene::read(&bundle).unwrap().gaussians.sh, sh);
}

#[test]
fn folders_have_limits() {
    let (_keep, path) = folder(&file());
    assert!(matches!(open(&path, 100), Err(Error::DoesNotFit { .. })));
    for i in 0..64 {
        fs::write(path.join(format!("{i}.txt")), "x").unwrap();
    }
    assert!(
        open(&path, u64::MAX)
            .unwrap_err()
            .to_string()
            .contains("more than 64 files")
    );
}
