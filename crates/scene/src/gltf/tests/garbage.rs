//! Random and damaged files: never a panic, and what is read is written back.
use super::*;
use proptest::prelude::*;

/// Reads a file and, if it is one, writes it, with its own colours and with others.
fn check(bytes: &[u8]) -> Result<(), TestCaseError> {
    for bad_rows in [BadRows::Refuse, BadRows::Ignore] {
        let Ok(scene) = read_with(bytes, bad_rows) else {
            continue;
        };
        prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);
        let sh = changed(&scene);
        if sh.coefficients.iter().all(|v| v.is_finite()) {
            let again = read_with(&written(&scene, &sh), bad_rows).unwrap();
            let mut expected = kept(&scene, &sh);
            expected.trim();
            prop_assert_eq!(again.gaussians.sh, expected);
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300), start in 0..3usize) {
        check(&[[&b"glTF"[..], b"glTF\x02\0\0\0\x80\0\0\0\x20\0\0\0JSON{", b"{\"asset\""][start], &bytes].concat())?;
    }

    #[test]
    fn damaged_files_never_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
        binary in any::<bool>(),
    ) {
        let mut bytes = if binary { asset() } else { text() };
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        check(&bytes)?;
    }

    /// Damage to numbers of the JSON, by which everything is found.
    #[test]
    fn damaged_numbers_never_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..4),
        binary in any::<bool>(),
    ) {
        let mut bytes = if binary { asset() } else { text() };
        let end = if binary { buffer_start(&bytes) - 8 } else { bytes.len() };
        let digits: Vec<usize> = (20..end).filter(|i| bytes[*i].is_ascii_digit()).collect();
        for (place, digit) in damage {
            bytes[digits[place.index(digits.len())]] = digit;
        }
        check(&bytes)?;
    }
}
