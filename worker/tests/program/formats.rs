//! Formats whose scenes are more than one file, or only a part of one, through the commands.
use std::path::Path;

use super::{Bench, files, write};

/// A bench with a key and settings of two steps.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.exits("key create --bits 32 --seed 7 -o k.key --device cpu", 0);
    let few = r#"{"steps": 2, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
        "verify": {"views": 3, "message_views": 3}}"#;
    write(&bench.path("few.json"), few);
    bench
}

fn embed(bench: &Bench, input: &str, output: &str, force: bool) {
    let force = if force { " --force" } else { "" };
    let line = format!(
        "embed {input} {output} --key k.key --message 0123abcd --preset draft --device cpu --size 32 --settings few.json{force}"
    );
    bench.exits(&line, 3);
}

fn verify(bench: &Bench, scene: &str) -> String {
    let line = format!("verify {scene} --key k.key --device cpu --views 3 --size 32 --json");
    bench.json(&line, 3)["message"].as_str().unwrap().to_owned()
}

/// The JSON and the buffer of a binary glTF.
fn chunks(file: &[u8]) -> (String, Vec<u8>) {
    let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(file[20..20 + length].to_vec()).unwrap();
    (text, file[28 + length..].to_vec())
}

fn read(bench: &Bench, name: &str) -> Vec<u8> {
    std::fs::read(bench.path(name)).unwrap()
}

#[test]
fn a_gltf_is_marked_in_place() {
    let bench = bench();
    bench.exits("sample in.glb --gaussians 300 --sh-degree 1 --seed 2", 0);
    embed(&bench, "in.glb", "out.glb", true);
    let (old, new) = (chunks(&read(&bench, "in.glb")), chunks(&read(&bench, "out.glb")));
    assert_eq!(old.0, new.0);
    // Geometry comes first: eleven numbers a Gaussian.
    let geometry = 300 * 44;
    assert_eq!(old.1[..geometry], new.1[..geometry]);
    assert_ne!(old.1[geometry..], new.1[geometry..]);
    let marked = verify(&bench, "out.glb");
    // The same scene as JSON with its buffer beside it.
    let own = bench.path("own");
    std::fs::create_dir(&own).unwrap();
    let text = old.0.replace("\"buffers\":[{", "\"buffers\":[{\"uri\":\"in.bin\",");
    write(&own.join("in.gltf"), text.trim_end());
    std::fs::write(own.join("in.bin"), &old.1).unwrap();
    embed(&bench, "own/in.gltf", "own/missed.gltf", false);
    assert_eq!(
        files(&own),
        ["in.bin", "in.gltf"],
        "what misses its target leaves nothing"
    );
    embed(&bench, "own/in.gltf", "own/out.gltf", true);
    assert_eq!(files(&own), ["in.bin", "in.gltf", "out.bin", "out.gltf"]);
    assert_eq!(read(&bench, "own/in.bin"), old.1);
    assert_eq!(read(&bench, "own/out.bin"), new.1);
    assert_eq!(
        String::from_utf8(read(&bench, "own/out.gltf")).unwrap(),
        text.trim_end().replace("in.bin", "out.bin")
    );
    assert_eq!(verify(&bench, "own/out.gltf"), marked);
    let told = bench.exits("inspect own/out.gltf", 0);
    assert!(told.contains("glTF"), "{told}");
    // What would be written over is told before the work.
    let told = bench.fails("embed in.glb out.gltf --key k.key --message 0123abcd --device cpu");
    assert!(told.contains("out.gltf would pass for glTF"), "{told}");
}

#[test]
fn scenes_are_converted_by_name() {
    let bench = bench();
    bench.exits("sample in.ply --gaussians 300 --sh-degree 3 --seed 2", 0);
    for name in ["a.glb", "a.gltf", "a.spz", "a.sog", "a.compressed.ply", "a.splat"] {
        let told = bench.exits(&format!("convert in.ply {name}"), 0);
        assert!(
            told.starts_with("300 Gaussians of degree 3 as PLY written to a."),
            "{told}"
        );
        bench.exits(&format!("convert {name} back.ply"), 0);
    }
    // Nothing is lost by way of glTF but the last digits of scales and opacities.
    bench.exits("convert a.glb b.glb", 0);
    let (first, second) = (chunks(&read(&bench, "a.glb")), chunks(&read(&bench, "b.glb")));
    assert_eq!(first.0, second.0);
    assert_eq!(first.1[300 * 44..], second.1[300 * 44..]);
    for name in ["a", "a.obj"] {
        let told = bench.fails(&format!("convert in.ply {name}"));
        assert!(
            told.contains("says no format: end it in one of .ply, .compressed.ply"),
            "{told}"
        );
    }
}

#[test]
fn the_folder_of_a_sog_is_marked_as_a_folder() {
    let bench = bench();
    bench.exits("sample in.sog --gaussians 300 --sh-degree 1 --seed 2", 0);
    let folder = bench.path("scene");
    unzip(&bench.path("in.sog"), &folder);
    embed(&bench, "scene", "marked", true);
    assert_eq!(files(&folder), files(&bench.path("marked")));
    embed(&bench, "in.sog", "out.sog", true);
    let marked = verify(&bench, "out.sog");
    assert_eq!(verify(&bench, "marked"), marked);
    embed(&bench, "scene", "bundled.sog", true);
    assert_eq!(verify(&bench, "bundled.sog"), marked);
    let line = "embed scene marked --key k.key --message 0123abcd --preset draft --device cpu --size 32";
    assert!(bench.fails(line).contains("not a regular file"));
}

fn unzip(file: &Path, folder: &Path) {
    let mut zip = zip::ZipArchive::new(std::fs::File::open(file).unwrap()).unwrap();
    zip.extract(folder).unwrap();
}
