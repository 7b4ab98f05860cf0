//! Marks are read for ever: keys and pictures of marks that shipped CLIPs made.
use std::path::PathBuf;

use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::{Engine, read_pictures};
use guardsplat_engine::message::Key;
use guardsplat_engine::quality::read_picture;

/// A sample scene that was marked with `message` by a CLIP of November 2026: two views of 200 pixels, and its key. All but so
/// many bits are read.
fn is_read(mark: &str, clip: &str, message: &str, wrong: u32) {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/marks_of_before")
        .join(mark);
    let key = Key::read(&folder.join("mark.key")).unwrap();
    assert_eq!(key.clip.name, clip);
    let compute = open(DeviceChoice::Cpu).unwrap();
    let clip = ShippedClip::named(clip).unwrap();
    let clip = clip.load(&compute.device, Parts::Image).unwrap();
    assert_eq!(clip.hash, key.clip.hash);
    let message = key.message(message).unwrap();
    let engine = Engine::new(compute, clip, &key, None).unwrap();
    let pictures = ["view_000.png", "view_001.png"].map(|name| read_picture(&folder.join(name), [1.0; 3]).unwrap());
    let read = read_pictures(&engine, &pictures).unwrap();
    let found = read
        .compare(&engine.message_code, &message, &engine.acceptance_rule(1))
        .unwrap();
    let least = message.len() as u32 - wrong;
    assert!(found.decision.matched_bits >= least, "{:?}", found.decision);
}

#[test]
fn a_mark_of_the_first_clip_is_read() {
    is_read("v1", "guardsplat", "c0ffee42", 1);
}

#[test]
fn a_mark_of_the_clip_for_short_messages_is_read() {
    is_read("short", "guardsplat-short", "beef", 0);
}
