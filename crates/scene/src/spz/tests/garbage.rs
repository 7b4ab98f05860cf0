//! Random and damaged files: never a panic, and what is read is written back.
use super::*;
use proptest::prelude::*;

/// Reads a file and, if it is one, writes it and reads that.
fn check(bytes: &[u8]) -> Result<(), TestCaseError> {
    let Ok(scene) = read(bytes) else {
        return Ok(());
    };
    let again = written(&scene, &scene.gaussians.sh);
    prop_assert_eq!(plain(&again), plain(bytes));
    prop_assert_eq!(read(&again).unwrap().gaussians, scene.gaussians);
    Ok(())
}

proptest! {
    #[test]
    fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300), start in 0..4usize) {
        let start = [&b"\x1f\x8b"[..], b"\x1f\x8b\x08\0\0\0\0\0\0\xff", b"NGSP", b"NGSP\x04\0\0\0"][start];
        check(&[start, &bytes].concat())?;
    }

    #[test]
    fn garbage_in_a_gzip_stream_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300), version in 1..5u8) {
        check(&gzip(&bytes))?;
        check(&gzip(&[b"NGSP", &[version, 0, 0, 0, 3, 0, 0, 0, 1, 12][..], &bytes].concat()))?;
    }

    #[test]
    fn damaged_files_never_panic(
        version in prop::sample::select(&VERSIONS[..]),
        degree in 0..=4u8,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
        inside in any::<bool>(),
    ) {
        let file = File::new(version, degree, 3);
        let inside = inside && version != 4;
        let mut bytes = if inside { file.content() } else { file.bytes() };
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        check(&if inside { gzip(&bytes) } else { bytes })?;
    }

    /// Damage to the first bytes, where the sizes are.
    #[test]
    fn damaged_headers_never_panic(
        version in prop::sample::select(&VERSIONS[..]),
        degree in 0..=4u8,
        damage in prop::collection::vec((0..128usize, any::<u8>()), 1..4),
    ) {
        let file = File::new(version, degree, 3);
        let mut bytes = if version == 4 { file.bytes() } else { file.content() };
        for (place, byte) in damage {
            let place = place % bytes.len().min(if version == 4 { 128 } else { 16 });
            bytes[place] = byte;
        }
        check(&if version == 4 { bytes } else { gzip(&bytes) })?;
    }
}
