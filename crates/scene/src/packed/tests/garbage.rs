//! Random and damaged files: never a panic.
use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn damaged_files_never_panic_and_what_is_read_is_written_back(
        rest in prop::sample::select(vec![0usize, 9, 24]),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = File::new(2, rest).bytes();
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        if let Ok(scene) = read(&bytes) {
            prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);
            let mut sh = scene.gaussians.sh.clone();
            sh.coefficients.fill(0.25);
            let again = read(&written(&scene, &sh)).unwrap();
            prop_assert_eq!(again.gaussians.len(), scene.gaussians.len());
        }
    }

    #[test]
    fn garbage_bodies_never_panic(body in prop::collection::vec(any::<u8>(), 72 + 3 * 16 + 3 * 9..300)) {
        let mut bytes = File::new(3, 9).header().into_bytes();
        bytes.extend(body);
        if let Ok(scene) = read(&bytes) {
            prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);
        }
    }

    #[test]
    fn shuffled_header_lines_never_panic(
        lines in prop::collection::vec(prop::sample::select(vec![
            "element vertex 3", "element vertex 0", "element chunk 1", "element chunk 18446744073709551615",
            "element sh 3", "property uint packed_position", "property uint packed_rotation",
            "property uint packed_scale", "property uint packed_color", "property float min_x", "property float min_r",
            "property uchar f_rest_0", "property list uchar int i", "comment",
        ]), 0..24),
        body in prop::collection::vec(any::<u8>(), 0..64),
    ) {
        let text = format!("ply\nformat binary_little_endian 1.0\n{}\nend_header\n", lines.join("\n"));
        let mut file = text.into_bytes();
        file.extend(body);
        let _ = read(&file);
    }
}
