//! Rows with numbers that are not legal, left out where that was asked for.
use super::*;
use crate::ignored::tests::without;
use crate::{BadRows, HEAD, sniff, summary};
use std::collections::BTreeSet;

fn ignoring(bytes: &[u8]) -> Result<Scene> {
    Scene::parse_with(Path::new("test.splat"), bytes, BadRows::Ignore)
}

/// Rows of different numbers and colours.
fn rows(count: usize) -> Vec<u8> {
    let one = |i: usize| {
        let colour = [i as u8, 51, 255, 204];
        row([i as f32, -2.0, 3.5, 1.0, 0.25, 0.5], colour, [192, 64, 192, 64])
    };
    (0..count).flat_map(one).collect()
}

proptest! {
    #[test]
    fn bad_rows_are_counted_and_never_change(
        count in 1..12usize,
        poisons in prop::collection::vec((0..12usize, 0..6usize, 0..4usize), 0..8),
        changes in prop::collection::vec(wild(), 36),
    ) {
        let good = rows(count);
        let (mut bytes, mut bad) = (good.clone(), BTreeSet::new());
        for (row, place, kind) in poisons {
            let row = row % count;
            let value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.5][kind];
            if place < 3 && kind == 3 {
                continue;
            }
            bytes[row * ROW + 4 * place..][..4].copy_from_slice(&value.to_le_bytes());
            bad.insert(row);
        }
        let told = |text: &str| bad.first().is_some_and(|row| text.contains(&format!(" of row {row} ")));
        match Scene::parse(Path::new("test.splat"), &bytes) {
            Ok(_) => prop_assert!(bad.is_empty()),
            Err(error) => prop_assert!(told(&error.to_string()), "{error}"),
        }
        let size = bytes.len() as u64;
        // More bad rows than good ones are no scene, whatever is asked for.
        if 2 * bad.len() > count {
            prop_assert!(told(&ignoring(&bytes).unwrap_err().to_string()));
            prop_assert_eq!(sniff(&bytes, size), None);
            return Ok(());
        }
        prop_assert_eq!(sniff(&bytes, size), Some(Format::Splat));
        prop_assert_eq!(summary(Path::new("it"), &bytes, size).unwrap().unwrap().gaussians, count as u64);
        let scene = ignoring(&bytes).unwrap();
        prop_assert_eq!(&scene.gaussians, &without(&read(&good).unwrap().gaussians, &bad));
        prop_assert_eq!(scene.ignored().map_or(0, |ignored| ignored.count()), bad.len());
        prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);

        let sh = Sh { degree: 0, coefficients: changes[..3 * scene.gaussians.len()].to_vec() };
        let out = written(&scene, &sh);
        let mut own = sh.clone();
        own.coefficients.chunks_exact_mut(3).enumerate().for_each(|(i, colour)| scene.quantize_colors(i, colour));
        prop_assert_eq!(&ignoring(&out).unwrap().gaussians.sh, &own);
        for (i, (old, new)) in bytes.chunks(ROW).zip(out.chunks(ROW)).enumerate() {
            prop_assert_eq!(&old[..COLOUR], &new[..COLOUR]);
            prop_assert_eq!(&old[COLOUR + 3..], &new[COLOUR + 3..]);
            prop_assert!(!bad.contains(&i) || old == new);
        }
    }
}

/// A bad row among the first is told by the reader, which goes through all of them.
#[test]
fn bad_rows_make_a_scene_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bin");
    let mut bytes = rows(3 * HEAD / ROW);
    bytes[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(Format::of(&path).unwrap(), Format::Splat);
    assert!(refused(&bytes).ends_with("since y of row 0 is NaN"));
    let ignored = Scene::read_with(&path, BadRows::Ignore).unwrap();
    assert_eq!(
        ignored.ignored().unwrap().to_string(),
        "1 row ignored: y of row 0 is NaN"
    );
}
