//! Buffers in files beside: read where that is allowed, from the folder of the scene only, and written under new names.
use super::*;

/// A folder with the asset, whose buffer is in a file `name`, referred to as `uri`.
fn folder(name: &str, uri: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("in.gltf"), json(Some(uri))).unwrap();
    let path = folder.path().join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, buffer()).unwrap();
    folder
}

fn open(folder: &tempfile::TempDir, memory: u64) -> Result<Scene, String> {
    let path = folder.path().join("in.gltf");
    Scene::read_with_files(&path, BadRows::Refuse, memory).map_err(|error| error.to_string())
}

#[test]
fn a_scene_of_two_files_is_written_as_two() {
    let folder = folder("data/all of it.bin", "data/all%20of%20it.bin");
    let scene = open(&folder, u64::MAX).unwrap();
    assert_eq!(scene.gaussians, read(&asset()).unwrap().gaussians);
    assert!(!scene.is_one_file());
    assert!(scene.encode(&scene.gaussians.sh, &mut Vec::new()).is_err());
    let sh = changed(&scene);
    let out = folder.path().join("märked.gltf");
    scene.write(&out, &sh).unwrap();
    let text = std::fs::read_to_string(&out).unwrap();
    assert_eq!(text, json(Some("m%C3%A4rked.bin")));
    let new = std::fs::read(folder.path().join("märked.bin")).unwrap();
    assert_eq!(new.len(), buffer().len());
    assert_eq!(
        std::fs::read(folder.path().join("data/all of it.bin")).unwrap(),
        buffer()
    );
    let again = Scene::read_with_files(&out, BadRows::Refuse, u64::MAX).unwrap();
    assert_eq!(again.gaussians.sh, kept(&scene, &sh));
}

/// The unmarked buffer is not written over, whatever the new file is called.
#[test]
fn the_old_buffer_keeps_its_name() {
    let folder = folder("out.bin", "out.bin");
    let scene = open(&folder, u64::MAX).unwrap();
    scene.write(&folder.path().join("out.gltf"), &changed(&scene)).unwrap();
    assert_eq!(std::fs::read(folder.path().join("out.bin")).unwrap(), buffer());
    let text = std::fs::read_to_string(folder.path().join("out.gltf")).unwrap();
    assert_eq!(text, json(Some("out-2.bin")));
}

#[test]
fn files_beside_are_read_only_where_that_is_asked_for() {
    let folder = folder("all.bin", "all.bin");
    let path = folder.path().join("in.gltf");
    let reason = Scene::read(&path).unwrap_err().to_string();
    assert!(
        reason.contains("buffer 0: in another file, \"all.bin\", and a scene has to be one here"),
        "{reason}"
    );
    assert!(Scene::read_within(&path, BadRows::Refuse, u64::MAX).is_err());
    assert!(read(json(Some("all.bin")).as_bytes()).is_err());
}

#[test]
fn no_reference_leads_out_of_the_folder() {
    let inner = folder("all.bin", "all.bin");
    let outside = inner.path().join("all.bin");
    let absolute = outside.to_str().unwrap();
    for uri in [
        "../all.bin",
        "data/../../all.bin",
        "%2e%2e/all.bin",
        absolute,
        "file:///etc/hostname",
        "https://example.org/all.bin",
        "..\\all.bin",
        "",
        "all.bin%00",
    ] {
        let folder = inner.path().join("scene");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("in.gltf");
        std::fs::write(&path, json(Some(uri))).unwrap();
        let reason = Scene::read_with_files(&path, BadRows::Refuse, u64::MAX)
            .unwrap_err()
            .to_string();
        assert!(
            reason.contains("must name a file in the folder of the scene"),
            "{uri}: {reason}"
        );
    }
}

#[test]
fn what_is_missing_short_or_too_large_is_refused() {
    let reason = |name: &str, uri: &str, memory| open(&folder(name, uri), memory).unwrap_err();
    assert!(reason("all.bin", "other.bin", u64::MAX).contains("other.bin: No such file"));
    assert!(reason("all/x", "all", u64::MAX).contains("not a regular file"));
    let size = json(Some("all.bin")).len() as u64;
    let told = reason("all.bin", "all.bin", size);
    assert!(told.contains("memory"), "{told}");
    let short = folder("all.bin", "all.bin");
    std::fs::write(short.path().join("all.bin"), &buffer()[..700]).unwrap();
    let told = open(&short, u64::MAX).unwrap_err();
    assert!(
        told.contains("buffer 0: truncated: byteLength") && told.contains("700 bytes are there"),
        "{told}"
    );
}

#[test]
fn a_write_that_fails_leaves_nothing() {
    let folder = folder("all.bin", "all.bin");
    let scene = open(&folder, u64::MAX).unwrap();
    let out = folder.path().join("out.gltf");
    std::fs::create_dir(&out).unwrap();
    assert!(scene.write(&out, &changed(&scene)).is_err());
    let mut there: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    there.sort();
    assert_eq!(there, ["all.bin", "in.gltf", "out.gltf"]);
}
