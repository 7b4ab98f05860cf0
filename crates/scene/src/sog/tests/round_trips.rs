//! Files that are written back differ in colours only.
use super::*;
use proptest::prelude::*;

#[test]
fn unchanged_colours_are_the_file_byte_for_byte() {
    for version in [1, 2] {
        for bands in 0..=3 {
            for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
                let mut file = File::new(version, bands, 9);
                file.method = method;
                let scene = file.read().unwrap();
                assert_eq!((scene.gaussians.len(), scene.gaussians.sh.degree), (9, bands));
                let bytes = file.bytes();
                assert!(written(&scene, &scene.gaussians.sh) == bytes);
                // What keep says of them is nothing new.
                assert_eq!(changed(&scene, |_, value| value), scene.gaussians.sh);
            }
        }
    }
}

#[test]
fn a_write_changes_three_bytes_a_pixel_and_nothing_else() {
    for version in [1, 2] {
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let mut file = File::new(version, 2, 9);
            file.method = method;
            file.others = vec![
                ("../thumb \u{e9}.bin".to_string(), vec![7; 300]),
                ("folder/".to_string(), Vec::new()),
            ];
            let bytes = file.bytes();
            let scene = read(&bytes).unwrap();
            let sh = changed(&scene, |i, value| if i == 4 { value + 0.4 } else { value });
            let out = written(&scene, &sh);
            assert!(out == written(&scene, &sh), "the same twice");

            let (old, new) = (unzip(&bytes), unzip(&out));
            assert_eq!(old.len(), new.len());
            for (old, new) in old.iter().zip(&new) {
                assert_eq!(old.0, new.0, "order");
                assert_eq!(old.1 == new.1, old.0 != "sh0", "{}", old.0);
            }
            // Gaussian 1, green; its alpha and all other pixels, those without Gaussians included, are as they were.
            let mut green = file.pixels("sh0")[1][1];
            let step = if version == 2 { 0.04 } else { 4.0 / 255.0 };
            green += (0.4f64 / step).round() as u8;
            let mut texel = file.pixels("sh0")[1];
            texel[1] = green;
            let mut expected = file.clone().pixel("sh0", 1, texel);
            let sh0 = new.iter().find(|(name, _)| name == "sh0").unwrap();
            assert_eq!(pixels(&sh0.1), *expected.pixels("sh0"));

            let again = read(&out).unwrap().gaussians;
            assert_eq!(again, expected.read().unwrap().gaussians);
            assert_eq!(again.sh, sh);
        }
    }
}

/// Pixels of a picture that this crate wrote.
fn pixels(webp: &[u8]) -> Vec<[u8; 4]> {
    let mut decoder = image_webp::WebPDecoder::new(Cursor::new(webp)).unwrap();
    let mut rgba = vec![0; decoder.output_buffer_size().unwrap()];
    decoder.read_image(&mut rgba).unwrap();
    rgba.as_chunks().0.to_vec()
}

/// Times, comments and packed bytes of entries are those of the file, and a time that is none is not now.
#[test]
fn entries_are_copied_packed() {
    let file = File::new(2, 0, 9);
    let time = zip::DateTime::from_date_and_time(1999, 8, 7, 6, 5, 4).unwrap();
    let mut out = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in file.entries() {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(1));
        let options = if name == "quats" {
            options
        } else {
            options.last_modified_time(time)
        };
        out.start_file(name, options).unwrap();
        out.write_all(&content).unwrap();
    }
    out.set_raw_comment(b"a comment"[..].into()).unwrap();
    let mut bytes = out.finish().unwrap().into_inner();
    // A date of zeros, as some writers leave it: month and day begin with 1.
    let central = find(&bytes, b"PK\x01\x02", "quats");
    bytes[central + 12..central + 16].fill(0);
    let scene = read(&bytes).unwrap();
    let out = written(&scene, &changed(&scene, |_, value| -value));
    let mut old = ZipArchive::new(Cursor::new(&bytes)).unwrap();
    let mut new = ZipArchive::new(Cursor::new(&out)).unwrap();
    assert_eq!(new.comment(), b"a comment");
    assert_eq!(old.len(), new.len());
    for i in 0..old.len() {
        let (mut old, mut new) = (old.by_index_raw(i).unwrap(), new.by_index_raw(i).unwrap());
        assert_eq!(old.name_raw(), new.name_raw());
        assert_eq!(old.compression(), new.compression());
        let expected = if old.name_raw() == b"quats" {
            zip::DateTime::default()
        } else {
            time
        };
        assert_eq!(new.last_modified(), Some(expected));
        if old.name_raw() == b"sh0" {
            continue;
        }
        let (mut packed, mut copied) = (Vec::new(), Vec::new());
        old.read_to_end(&mut packed).unwrap();
        new.read_to_end(&mut copied).unwrap();
        assert_eq!(packed, copied);
        assert_eq!(old.crc32(), new.crc32());
    }
}

/// Where the header of an entry with that signature starts.
pub(super) fn find(bytes: &[u8], signature: &[u8], name: &str) -> usize {
    let name_at = if signature[2] == 1 { 46 } else { 30 };
    (0..bytes.len())
        .find(|i| {
            bytes[*i..].starts_with(signature)
                && bytes.get(i + name_at..).is_some_and(|b| b.starts_with(name.as_bytes()))
        })
        .unwrap()
}

/// Old tools wrote null as the first number of a table, and players take it for one a little below the second.
#[test]
fn a_first_number_that_is_null() {
    let file = File::new(2, 0, 9)
        .with("/sh0/codebook/0", Value::Null)
        .pixel("sh0", 2, [0, 1, 2, 3]);
    let bytes = file.bytes();
    let scene = read(&bytes).unwrap();
    // Numbers 1 and 255 of the table are -2.46 and 7.7.
    let first = scene.gaussians.sh.coefficients[6];
    assert!((first - (-2.46 - 10.16 / 255.0)).abs() < 1e-5, "{first}");
    assert!(written(&scene, &scene.gaussians.sh) == bytes);
    // The colour stays where it is, and no other Gaussian gets it.
    let sh = changed(&scene, |_, _| first);
    assert_eq!(sh.coefficients[6], first);
    assert_eq!(sh.coefficients[7], -2.46);
    assert_eq!(read(&written(&scene, &sh)).unwrap().gaussians.sh, sh);
}

fn wild() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<f32>().prop_filter("finite", |value| value.is_finite()),
        -4.0f32..4.0,
        prop::sample::select(vec![1e30, -1e30, f32::MAX, f32::MIN, 1e-45, -1e-45, 0.0, -0.0]),
    ]
}

proptest! {
    /// What keep says is what comes back, bit by bit, whatever the table.
    #[test]
    fn what_is_kept_comes_back(
        version in 1..=2u64,
        bands in 0..=2usize,
        codebook in prop::collection::vec(prop_oneof![4 => (-3.0..3.0f64).prop_map(Some), 1 => Just(Some(0.5)), 1 => Just(Some(-0.0)), 1 => Just(None)], 256),
        ends in prop::array::uniform4(-1e38..1e38f64),
        colours in prop::collection::vec(wild(), 7 * 27),
    ) {
        let mut file = File::new(version, bands, 7);
        if version == 1 {
            file = file.with("/sh0/mins", json!([ends[0], ends[1], 0.25, 0.0]));
            file = file.with("/sh0/maxs", json!([ends[2], ends[3], 0.25, 0.0]));
        } else {
            // Indices without a number are refused where a Gaussian has one.
            let known: Vec<u8> = (1..=255).filter(|i| codebook[usize::from(*i)].is_some()).collect();
            prop_assume!(!known.is_empty());
            for texel in file.pixels("sh0") {
                texel[..3].iter_mut().for_each(|byte| *byte = known[usize::from(*byte) % known.len()]);
            }
            file = file.with("/sh0/codebook", json!(codebook));
        }
        let bytes = file.bytes();
        let scene = read(&bytes).unwrap();
        let mut sh = scene.gaussians.sh.clone();
        let per_gaussian = sh.per_gaussian();
        for row in 0..7 {
            let colour = &mut sh.coefficients[row * per_gaussian..][..per_gaussian];
            let own = bits(colour);
            scene.quantize_colors(row, colour);
            prop_assert_eq!(&own, &bits(colour), "the file's own");
            colour.copy_from_slice(&colours[27 * row..][..per_gaussian]);
            scene.quantize_colors(row, colour);
            let kept = bits(colour);
            scene.quantize_colors(row, colour);
            prop_assert_eq!(kept, bits(colour), "again");
        }
        let again = read(&written(&scene, &sh)).unwrap().gaussians;
        prop_assert_eq!(bits(&again.sh.coefficients), bits(&sh.coefficients));
        let mut geometry = scene.gaussians.clone();
        geometry.sh = sh.clone();
        prop_assert_eq!(&again, &geometry);
        // Colours that were not asked about first are written as what keep would have said.
        let mut raw = sh.clone();
        raw.coefficients.copy_from_slice(&colours[..sh.coefficients.len()]);
        let out = read(&written(&scene, &raw)).unwrap().gaussians.sh;
        for row in 0..7 {
            let mut colour = raw.coefficients[row * per_gaussian..][..per_gaussian].to_vec();
            scene.quantize_colors(row, &mut colour);
            prop_assert_eq!(bits(&colour), bits(&out.coefficients[row * per_gaussian..][..per_gaussian]));
        }
    }
}
