//! Attacks with copies alone: marked again, averaged, moved to other Gaussians, claimed after they were read.
use std::sync::LazyLock;

use guardsplat_tests::ply::Ply;
use guardsplat_tests::{TestEnvironment, real_scene};

/// Words of 64 bits: of the owner's first buyer, of the second, and of a rival.
const FIRST: &str = "5c1d9e20f7a8346b";
const SECOND: &str = "a90b47e31c6fd852";
const RIVAL: &str = "37d2c86150be94fa";

/// The original and copies of it, all in one layout.
struct Copies {
    files: Vec<(&'static str, Vec<u8>)>,
}

/// Marks a real scene for two buyers, and has a rival mark the first one's copy again.
static COPIES: LazyLock<Option<Copies>> = LazyLock::new(|| {
    let scene = real_scene("playbot_8k.ply")?;
    let environment = TestEnvironment::new();
    environment.write("in.ply", std::fs::read(scene).unwrap());
    for (key, seed) in [("owner.key", 1), ("rival.key", 2)] {
        environment.exits(&format!("key create --bits 64 --seed {seed} -o {key} --device cpu"), 0);
    }
    for (from, to, key, word) in [
        ("in.ply", "first.ply", "owner.key", FIRST),
        ("in.ply", "second.ply", "owner.key", SECOND),
        ("first.ply", "again.ply", "rival.key", RIVAL),
    ] {
        let line = format!("embed {from} {to} --key {key} --message {word} --preset draft --force --device cpu --json");
        let output = environment.run(&line);
        assert!(matches!(output.status.code(), Some(0 | 3)), "{line}");
        println!("{from} to {to}: {}", String::from_utf8_lossy(&output.stdout));
    }
    let names = [
        "in.ply",
        "first.ply",
        "second.ply",
        "again.ply",
        "owner.key",
        "rival.key",
    ];
    Some(Copies {
        files: names.map(|name| (name, environment.read(name))).into(),
    })
});

/// A folder with all of them, or `None` without the scene.
fn environment() -> Option<TestEnvironment> {
    let copies = COPIES.as_ref()?;
    let environment = TestEnvironment::new();
    for (name, bytes) in &copies.files {
        environment.write(name, bytes);
    }
    Some(environment)
}

/// Bits of `word` that a scene reads, of 64.
fn matched(environment: &TestEnvironment, scene: &str, key: &str, word: &str) -> u64 {
    let line = format!("verify {scene} --key {key} --message {word} --device cpu --json");
    let report: serde_json::Value = serde_json::from_slice(&environment.run(&line).stdout).unwrap();
    println!(
        "{scene}, {key}, {word}: {} {}",
        report["verdict"], report["matched_bits"]
    );
    report["matched_bits"].as_u64().unwrap()
}

/// What a match takes with one hypothesis.
const NEEDED: u64 = 51;

/// A scene with its colours, those columns that a mark changes, made anew from those of other scenes.
fn mixed(environment: &TestEnvironment, into: &str, from: &[&str], to: &str, mix: impl Fn(usize, &[f32]) -> f32) {
    let scenes: Vec<Ply> = from.iter().map(|name| Ply::parse(&environment.read(name))).collect();
    let mut scene = Ply::parse(&environment.read(into));
    let colours: Vec<usize> = (scene.properties.iter().enumerate())
        .filter(|(_, name)| name.starts_with("f_"))
        .map(|(place, _)| place)
        .collect();
    for row in 0..scene.rows.len() {
        for &place in &colours {
            let values: Vec<f32> = scenes
                .iter()
                .map(|other| other.rows[row % other.rows.len()][place])
                .collect();
            scene.rows[row][place] = mix(row, &values);
        }
    }
    environment.write(to, scene.bytes());
}

#[test]
fn a_rival_who_marks_again_overwrites_the_mark_and_is_not_in_the_original() {
    let Some(environment) = environment() else { return };
    assert!(matched(&environment, "first.ply", "owner.key", FIRST) >= NEEDED);
    // The attack that works: the second mark is what is read, and the first is gone. (When this fails, tell
    // docs/security.md.)
    assert!(matched(&environment, "again.ply", "owner.key", FIRST) < NEEDED);
    assert!(matched(&environment, "again.ply", "rival.key", RIVAL) >= NEEDED);
    // What tells who was first is that the owner's copies, and the original, have none of the rival's.
    assert!(matched(&environment, "first.ply", "rival.key", RIVAL) < NEEDED);
    assert!(matched(&environment, "in.ply", "rival.key", RIVAL) < NEEDED);
    assert!(matched(&environment, "in.ply", "owner.key", FIRST) < NEEDED);
}

#[test]
fn whoever_averages_two_copies_weakens_both_marks() {
    let Some(environment) = environment() else { return };
    mixed(
        &environment,
        "first.ply",
        &["first.ply", "second.ply"],
        "mean.ply",
        |_, v| (v[0] + v[1]) / 2.0,
    );
    let before = matched(&environment, "first.ply", "owner.key", FIRST);
    let words = [FIRST, SECOND].map(|word| matched(&environment, "mean.ply", "owner.key", word));
    // The attack that works: where the words differ, half of the bits, nothing is left of either.
    assert!(words.iter().all(|n| *n < before), "{words:?} of {before}");
}

#[test]
fn a_mark_that_is_copied_to_other_gaussians_is_not_read() {
    let Some(environment) = environment() else { return };
    // Whoever has original and copy knows what was added to each Gaussian. Added to those of another scene, or to others of
    // the same one, it says nothing: a mark is what was added together with what was there.
    let sample = "sample other.ply --gaussians 8000 --sh-degree 3 --seed 3";
    environment.exits(sample, 0);
    mixed(
        &environment,
        "other.ply",
        &["first.ply", "in.ply", "other.ply"],
        "copied.ply",
        |_, v| v[2] + v[0] - v[1],
    );
    assert!(matched(&environment, "copied.ply", "owner.key", FIRST) < NEEDED);
}

#[test]
fn a_raw_message_that_was_read_before_it_was_claimed_matches() {
    let Some(environment) = environment() else { return };
    // Why raw messages prove nothing by themselves: the unmarked original reads as something, which anybody can claim.
    let read = environment.json("verify in.ply --key owner.key --device cpu --json", 3);
    let word = read["message"].as_str().unwrap();
    assert_eq!(matched(&environment, "in.ply", "owner.key", word), 64);
}
