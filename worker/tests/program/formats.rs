//! Formats whose scenes are more than one file, or only a part of one, through the commands.
use std::path::Path;

use guardsplat_engine::scene::Scene;
use guardsplat_engine::scene::alter::halved;
use guardsplat_engine::scene::testing::write_streamed_sog;

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
    for name in [
        "a.glb",
        "a.gltf",
        "a.spz",
        "a.sog",
        "a.compressed.ply",
        "a.splat",
        "a.ksplat",
    ] {
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

#[test]
fn every_level_of_a_streamed_sog_is_marked() {
    let bench = bench();
    bench.exits("sample in.ply --gaussians 300 --sh-degree 1 --seed 2", 0);
    let finest = Scene::read(&bench.path("in.ply")).unwrap().into_gaussians();
    let coarser = halved(&finest).unwrap();
    write_streamed_sog(&bench.path("scene"), &[finest, coarser], 2).unwrap();
    // Two steps miss the target: the first level ends it, and nothing is there.
    embed(&bench, "scene", "missed", false);
    assert!(!bench.path("missed").exists());
    embed(&bench, "scene/lod-meta.json", "marked", true);
    assert_eq!(files(&bench.path("marked")), files(&bench.path("scene")));
    for tile in ["0_0", "0_1", "1_0", "1_1"] {
        for name in files(&bench.path("scene").join(tile)) {
            let [old, new] = ["scene", "marked"].map(|scene| read(&bench, &format!("{scene}/{tile}/{name}")));
            assert_eq!(old == new, name != "sh0.webp", "{tile}/{name}");
        }
    }
    assert_eq!(
        read(&bench, "marked/lod-meta.json"),
        read(&bench, "scene/lod-meta.json")
    );
    // A level reads as it does by itself; the finest is read unless another is asked for.
    for level in 0..2 {
        bench.exits(&format!("convert marked level-{level}.ply --level {level}"), 0);
        let alone = verify(&bench, &format!("level-{level}.ply"));
        assert_eq!(verify(&bench, &format!("marked --level {level}")), alone);
    }
    assert_eq!(verify(&bench, "marked"), verify(&bench, "marked/lod-meta.json"));
    bench.exits("render marked views --views 1 --size 32 --level 1 --device cpu", 0);
    assert!(bench.exits("inspect marked --level 1", 0).contains("150"));
    assert!(
        bench
            .fails("convert marked x.ply --level 2")
            .contains("no level 2: there are 2")
    );
    assert!(
        bench
            .fails("convert in.ply x.ply --level 1")
            .contains("only a SOG with a lod-meta.json")
    );
    let line = "embed scene marked --key k.key --message 0123abcd --preset draft --device cpu --size 32";
    assert!(bench.fails(line).contains("under a new name"));
    assert!(
        bench
            .fails(&format!("{line}2 --credentials c.c2pa"))
            .contains("--credentials")
    );
}

#[test]
fn a_ksplat_is_marked_in_place() {
    let bench = bench();
    bench.exits("sample in.ksplat --gaussians 300 --sh-degree 1 --seed 2", 0);
    embed(&bench, "in.ksplat", "out.ksplat", true);
    let (old, new) = (read(&bench, "in.ksplat"), read(&bench, "out.ksplat"));
    assert_ne!(old, new);
    // Headers, then rows of 80 bytes: 40 of geometry, colour, opacity, harmonics.
    let may = |i: usize| i >= 5120 && (i - 5120) % 80 >= 40 && (i - 5120) % 80 != 43;
    assert_eq!(old.len(), new.len());
    assert!((0..old.len()).all(|i| may(i) || old[i] == new[i]));
    bench.exits("convert out.ksplat out.ply", 0);
    assert_eq!(verify(&bench, "out.ksplat"), verify(&bench, "out.ply"));
    let told = bench.exits("inspect out.ksplat", 0);
    assert!(told.contains(".ksplat"), "{told}");
    let line = "embed in.ksplat out.splat --key k.key --message 0123abcd --device cpu";
    assert!(bench.fails(line).contains("name it *.ksplat"));
}

fn unzip(file: &Path, folder: &Path) {
    let mut zip = zip::ZipArchive::new(std::fs::File::open(file).unwrap()).unwrap();
    zip.extract(folder).unwrap();
}
