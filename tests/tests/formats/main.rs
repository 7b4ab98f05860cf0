//! Scenes of every format are drawn, marked and written so that programs of other authors read what we read.
mod compare;

use std::path::Path;
use std::sync::LazyLock;

use guardsplat_engine::testing::tiny;
use guardsplat_scene::{Format, Scene};
use guardsplat_tests::{Reader, TestEnvironment, real_scene};

/// Few and small views, steps that files of 8 bits see, and a target that any result reaches.
const SETTINGS: &str = r#"{"steps": 4, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
    "adam": {"rate_dc": 0.05, "rate_rest": 0.05}, "verify": {"views": 2, "message_views": 2},
    "target": {"bit_accuracy": 0, "psnr_db": 0, "message": false}}"#;

/// A key for a tiny CLIP with random weights: marks are made with it, whatever they are worth.
static KEY: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let environment = environment_without_key();
    environment.exits("key create --bits 32 --seed 5 -o k.key --device cpu", 0);
    environment.read("k.key")
});

fn environment_without_key() -> TestEnvironment {
    let mut environment = TestEnvironment::new();
    tiny::write(&environment.path("clip"));
    environment.set("GUARDSPLAT_CLIP", environment.path("clip"));
    environment
}

fn environment() -> TestEnvironment {
    let environment = environment_without_key();
    environment.write("k.key", &*KEY);
    environment.write("hasty.json", SETTINGS);
    environment
}

/// Draws a scene, marks it, and has the marked file read by other programs.
fn check(scene: &Path, format: Format, readers: &[Reader]) {
    let environment = environment();
    let extension = format.extension();
    let (input, output) = (format!("in.{extension}"), format!("out.{extension}"));
    std::fs::copy(scene, environment.path(&input)).unwrap();
    environment.exits(&format!("render {input} views --views 1 --size 48 --device cpu"), 0);
    let report = environment.json(
        &format!(
            "embed {input} {output} --key k.key --message c0ffee42 --settings hasty.json --size 32 --force --preset \
             draft --device cpu --json"
        ),
        0,
    );
    let [before, after] = [&input, &output].map(|name| Scene::read(&environment.path(name)).unwrap());
    assert_eq!([before.format(), after.format()], [format; 2]);
    let changed = compare::changed(&before.gaussians, &after.gaussians);
    // New ranges of a compressed PLY move colours of Gaussians that nobody sees, too.
    let learned = report["changed_gaussians"].as_u64().unwrap() as usize;
    assert!(
        learned > 100 && changed >= learned,
        "{changed} changed, {learned} were learned"
    );
    assert!(format == Format::CompressedPly || changed == learned);

    for reader in readers {
        let [original, marked] = [&input, &output].map(|name| {
            let found = reader.read(&environment.path(name), &environment.path(format!("{name}.read.ply")));
            let turned = reader.turns(name.as_ref());
            compare::agrees(&Scene::read(&environment.path(name)).unwrap(), &found, turned);
            found
        });
        assert_eq!(compare::marked_rows(&original, &marked), changed, "{reader:?}");
    }
}

/// The readers that can be had; without any the test is skipped.
fn readers(with_gsply: bool) -> Vec<Reader> {
    let gsply = with_gsply.then(Reader::gsply).flatten();
    Reader::splat_transform().into_iter().chain(gsply).collect()
}

#[test]
fn ply() {
    let Some(scene) = real_scene("donut.ply") else { return };
    check(&scene, Format::Ply, &readers(true));
}

#[test]
fn compressed_ply() {
    let Some(scene) = real_scene("biker.compressed.ply") else {
        return;
    };
    check(&scene, Format::CompressedPly, &readers(true));
}

#[test]
fn splat() {
    let Some(scene) = real_scene("plant.splat") else { return };
    // gsply does not read the format.
    check(&scene, Format::Splat, &readers(false));
}

#[test]
fn spz_of_version_2_with_harmonics() {
    let Some(scene) = real_scene("pod.spz") else { return };
    check(&scene, Format::Spz, &readers(true));
}

#[test]
fn spz_of_version_4() {
    let Some(scene) = real_scene("biker.spz") else { return };
    check(&scene, Format::Spz, &readers(true));
}

/// Made of a PLY by the other program first: version 3, and a SOG.
#[test]
fn converted_scenes() {
    let (Some(scene), Some(converter)) = (real_scene("playbot_8k.ply"), Reader::splat_transform()) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for format in [Format::CompressedPly, Format::Spz] {
        let converted = folder.path().join(format!("converted.{}", format.extension()));
        converter.convert(&scene, &converted);
        check(&converted, format, std::slice::from_ref(&converter));
    }
}

/// The same scene in two formats looks the same from the same cameras.
#[test]
fn spz_and_ply_of_a_scene_look_alike() {
    let (Some(spz), Some(ply)) = (real_scene("pod.spz"), real_scene("pod.ply")) else {
        return;
    };
    let environment = TestEnvironment::new();
    let [spz, ply] = [spz, ply].map(|path| path.display().to_string());
    environment.exits(&format!("render {spz} spz --views 3 --size 256 --device cpu"), 0);
    environment.exits(&format!("render {ply} ply --cameras spz/cameras.json --device cpu"), 0);
    environment.exits(
        &format!("render {spz} again --cameras spz/cameras.json --device cpu"),
        0,
    );
    compare::pictures_agree(&environment, "again", "ply", 3);
}
