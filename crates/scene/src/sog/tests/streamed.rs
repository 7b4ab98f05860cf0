//! Scenes that are streamed in levels of detail: every level is a scene, and is written back into all of them.
use super::*;
use crate::alter::halved;
use crate::convert::tests::random;
use crate::sog::INDEX;
use crate::testing::write_streamed_sog;
use crate::{BadRows, Format, StreamedSog};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

/// A scene of three levels in two tiles, with an environment and a licence, in a folder that goes with the first.
fn streamed(degree: usize) -> (tempfile::TempDir, PathBuf) {
    let keep = tempfile::tempdir().unwrap();
    let path = keep.path().join("scene");
    let finest = random(600, degree, 3);
    let coarser = halved(&finest).unwrap();
    let coarsest = halved(&coarser).unwrap();
    write_streamed_sog(&path, &[finest, coarser, coarsest], 2).unwrap();
    fs::create_dir(path.join("env")).unwrap();
    fs::copy(path.join("2_0/meta.json"), path.join("env/meta.json")).unwrap();
    fs::write(path.join("licence.txt"), "ours").unwrap();
    (keep, path)
}

fn contents(path: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(path).unwrap() {
        let file = entry.unwrap().path();
        match file.is_dir() {
            true => all.extend(
                contents(&file)
                    .into_iter()
                    .map(|(name, content)| (Path::new(file.file_name().unwrap()).join(name), content)),
            ),
            false => _ = all.insert(file.file_name().unwrap().into(), fs::read(&file).unwrap()),
        }
    }
    all
}

fn reason<T: std::fmt::Debug>(result: Result<T>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn every_level_is_a_scene() {
    let (_keep, path) = streamed(1);
    let streamed = StreamedSog::open(&path).unwrap().unwrap();
    assert_eq!(
        (streamed.levels(), streamed.gaussians(0), streamed.gaussians(2)),
        (3, 600, 150)
    );
    assert_eq!(streamed.gaussians(3), 0);
    for level in 0..3 {
        let scene = streamed.read(level, BadRows::Refuse, u64::MAX).unwrap();
        assert_eq!(
            (scene.format(), scene.is_one_file(), scene.learnable_degree()),
            (Format::Sog, false, 0)
        );
        // Of both tiles, in the order of the index.
        let part = |name: &str| {
            let folder = path.join(format!("{level}_{name}"));
            Scene::read_with_files(&folder, BadRows::Refuse, u64::MAX)
                .unwrap()
                .gaussians
        };
        let (a, b) = (part("0"), part("1"));
        assert_eq!(scene.gaussians.positions, [a.positions, b.positions].concat());
        assert_eq!(
            scene.gaussians.sh.coefficients,
            [a.sh.coefficients, b.sh.coefficients].concat()
        );
        let again = Scene::read_level(&path.join(INDEX), level, BadRows::Refuse, u64::MAX).unwrap();
        assert_eq!(again.gaussians, scene.gaussians);
        if level == 0 {
            let finest = Scene::read_with_files(&path, BadRows::Refuse, u64::MAX).unwrap();
            assert_eq!(finest.gaussians, scene.gaussians);
        }
    }
    assert!(crate::is_loose_sog(&path), "its pictures are no views");
    assert!(reason(Scene::read_level(&path, 3, BadRows::Refuse, u64::MAX)).contains("no level 3: there are 3, from 0"));
    assert!(reason(Scene::read(&path.join(INDEX))).contains("the lod-meta.json of a streamed SOG without its files"));
    let other = path.join("licence.txt");
    assert!(StreamedSog::open(&other).unwrap().is_none());
    assert!(
        reason(Scene::read_level(&other, 1, BadRows::Refuse, u64::MAX)).contains("only a SOG with a lod-meta.json")
    );
}

#[test]
fn levels_are_marked_and_put_together_with_one_picture_changed_in_each() {
    let (keep, path) = streamed(1);
    let streamed = StreamedSog::open(&path).unwrap().unwrap();
    let (out, work) = (keep.path().join("marked"), keep.path().join("level"));
    fs::create_dir(&out).unwrap();
    streamed.copy_rest(&out).unwrap();
    let mut marked = Vec::new();
    for level in 0..3 {
        let scene = streamed.read(level, BadRows::Refuse, u64::MAX).unwrap();
        let sh = changed(&scene, |i, value| if i % 3 == 1 { value + 0.2 } else { value });
        scene.write(&work, &sh).unwrap();
        // It reads back as a scene of that level alone.
        let again = Scene::read_with_files(&work, BadRows::Refuse, u64::MAX).unwrap();
        assert_eq!(
            (&again.gaussians.sh, &again.gaussians.positions),
            (&sh, &scene.gaussians.positions)
        );
        assert!(reason(scene.write(&work, &sh)).contains("new name"));
        assert!(reason(scene.write(&keep.path().join("one.sog"), &sh)).contains("as a folder"));
        streamed.move_level(level, &work, &out).unwrap();
        fs::remove_dir_all(&work).unwrap();
        marked.push(sh);
    }
    for (level, sh) in marked.iter().enumerate() {
        assert_eq!(
            &Scene::read_level(&out, level, BadRows::Refuse, u64::MAX)
                .unwrap()
                .gaussians
                .sh,
            sh
        );
    }
    let (old, new) = (contents(&path), contents(&out));
    assert!(old.keys().eq(new.keys()));
    for (name, content) in &old {
        let colours = name.ends_with("sh0.webp") && !name.starts_with("env");
        assert_eq!(content == &new[name], !colours, "{}", name.display());
    }
}

#[test]
fn what_does_not_fit_the_index_or_the_memory_is_refused() {
    let (_keep, path) = streamed(0);
    let read = |memory| Scene::read_with_files(&path, BadRows::Refuse, memory);
    assert!(matches!(read(9_000), Err(Error::DoesNotFit { .. })));
    let whole = read(u64::MAX).unwrap();
    assert!(
        read(whole.file_bytes() as u64 + 600 * 56 / 2).is_err(),
        "the second tile finds too little"
    );
    let index = path.join(INDEX);
    let text = fs::read_to_string(&index).unwrap();
    let count = StreamedSog::open(&path).unwrap().unwrap().gaussians(0);
    assert_eq!(count, 600);
    fs::rename(path.join("0_0"), path.join("away")).unwrap();
    assert!(reason(read(u64::MAX)).contains("0_0"));
    fs::rename(path.join("1_0"), path.join("0_0")).unwrap();
    assert!(reason(read(u64::MAX)).contains("Gaussians, of which lod-meta.json has"));
    fs::write(&index, text.replace("1_1/meta.json", "../meta.json")).unwrap();
    assert!(reason(read(u64::MAX)).contains("lod-meta.json: filenames"));
    fs::write(&index, "{}").unwrap();
    assert!(reason(read(u64::MAX)).contains("no lodLevels at its beginning"));
}
