//! Random and damaged files: never a panic.
use super::*;
use crate::BadRows;
use proptest::prelude::*;

proptest! {
    #[test]
    fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300), start in 0..3usize) {
        let mut file = [&b""[..], b"ply\n", b"ply\nformat ascii 1.0\n"][start].to_vec();
        file.extend(bytes);
        let _ = read(&file);
    }

    #[test]
    fn damaged_files_never_panic_and_what_is_read_is_written_back(
        encoding in prop::sample::select(&ENCODINGS[..]),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = File::new(encoding, 1, 2).bytes();
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        for scene in [read(&bytes), Scene::parse_with(Path::new("it"), &bytes, BadRows::Ignore)].into_iter().flatten() {
            let mut out = Vec::new();
            scene.encode(&scene.gaussians.sh, &mut out).unwrap();
            prop_assert_eq!(out, bytes.clone());
        }
    }

    #[test]
    fn shuffled_header_lines_never_panic(
        lines in prop::collection::vec(prop::sample::select(vec![
            "format ascii 1.0", "format binary_little_endian 1.0", "element vertex 3", "element vertex 0",
            "element face 99999999999", "property float x", "property list uchar int i", "property double y",
            "comment", "obj_info a b", "end_header", "property uchar f_rest_0", "element e 18446744073709551615",
        ]), 0..14),
        body in prop::collection::vec(any::<u8>(), 0..64),
    ) {
        let mut file = format!("ply\n{}\nend_header\n", lines.join("\n")).into_bytes();
        file.extend(body);
        let _ = read(&file);
    }
}
