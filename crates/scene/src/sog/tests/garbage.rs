//! Random and damaged files: never a panic.
use super::*;
use crate::BadRows;
use proptest::prelude::*;

proptest! {
    #[test]
    fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300), start in 0..3usize) {
        let mut file = [&b"PK\x03\x04"[..], b"{\"means\":", b"PK\x05\x06"][start].to_vec();
        file.extend(bytes);
        let _ = read(&file);
    }

    #[test]
    fn damaged_files_never_panic_and_what_is_read_is_written_back(
        version in 1..=2u64,
        deflated: bool,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
    ) {
        let mut file = File::new(version, 1, 5);
        if deflated {
            file.method = CompressionMethod::Deflated;
        }
        let mut bytes = file.bytes();
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        check(&bytes);
    }

    /// Damage that the checksums of the archive do not catch.
    #[test]
    fn damaged_entries_never_panic_and_what_is_read_is_written_back(
        version in 1..=2u64,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of((any::<prop::sample::Index>(), any::<prop::sample::Index>())),
    ) {
        let mut entries = File::new(version, 1, 5).entries();
        for (entry, place, byte) in damage {
            let entry = entry.index(entries.len());
            let place = place.index(entries[entry].1.len());
            entries[entry].1[place] = byte;
        }
        if let Some((entry, place)) = cut {
            let entry = entry.index(entries.len());
            let place = place.index(entries[entry].1.len());
            entries[entry].1.truncate(place);
        }
        check(&zip(&entries, CompressionMethod::Stored));
    }
}

fn check(bytes: &[u8]) {
    for bad_rows in [BadRows::Refuse, BadRows::Ignore] {
        let read = |bytes: &[u8]| Scene::parse_with(Path::new("it"), bytes, bad_rows);
        let Ok(scene) = read(bytes) else {
            continue;
        };
        assert!(written(&scene, &scene.gaussians.sh) == bytes);
        let sh = changed(&scene, |i, value| value + i as f32);
        let again = read(&written(&scene, &sh)).unwrap();
        assert_eq!(again.ignored(), scene.ignored());
        let again = again.gaussians;
        assert_eq!(bits(&again.sh.coefficients), bits(&sh.coefficients));
        assert_eq!(again.positions, scene.gaussians.positions);
        assert_eq!(again.opacity_logits, scene.gaussians.opacity_logits);
    }
}
