//! Marks are read for ever: keys and pictures of marks that shipped CLIPs made.
use std::path::PathBuf;

use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::{Engine, read_pictures};
use guardsplat_engine::message::Key;
use guardsplat_engine::quality::read_picture;

/// A sample scene that was marked with c0ffee42 by `guardsplat` of November 2026, two views of 200 pixels, and its key.
#[test]
fn a_mark_of_november_2026_is_read() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/marks_of_before/v1");
    let key = Key::read(&folder.join("mark.key")).unwrap();
    let compute = open(DeviceChoice::Cpu).unwrap();
    let clip = ShippedClip::named(&key.clip.name).unwrap();
    let clip = clip.load(&compute.device, Parts::Image).unwrap();
    assert_eq!(clip.hash, key.clip.hash);
    let message = key.message("c0ffee42").unwrap();
    let engine = Engine::new(compute, clip, &key, None).unwrap();
    let pictures = ["view_000.png", "view_001.png"].map(|name| read_picture(&folder.join(name), [1.0; 3]).unwrap());
    let read = read_pictures(&engine, &pictures).unwrap();
    let found = read
        .compare(&engine.message_code, &message, &engine.acceptance_rule(1))
        .unwrap();
    assert!(found.decision.matched_bits >= 31, "{:?}", found.decision);
}
