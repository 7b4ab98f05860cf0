//! Reading and writing again: what was read comes back bit by bit, and nothing but colours changes.
use super::*;

/// The bytes of the buffer at which files differ.
fn differences(a: &[u8], b: &[u8]) -> Vec<usize> {
    assert_eq!(a.len(), b.len());
    let start = buffer_start(a);
    let all = (0..a.len()).filter(|i| a[*i] != b[*i]);
    all.map(|i| i.checked_sub(start).expect("the JSON is as it was"))
        .collect()
}

#[test]
fn a_scene_with_its_own_colours_is_the_same_file() {
    for (file, format) in [(asset(), Format::Glb), (text(), Format::Gltf)] {
        let scene = read(&file).unwrap();
        assert_eq!(
            (scene.format(), scene.exact(), scene.is_one_file()),
            (format, false, true)
        );
        assert_eq!(scene.learnable_degree(), 3);
        assert!(written(&scene, &scene.gaussians.sh) == file, "{format:?}");
        assert!(scene.file_bytes() >= file.len());
    }
}

#[test]
fn colours_come_back_as_they_are_kept_and_nothing_else_changes() {
    let file = asset();
    let scene = read(&file).unwrap();
    let sh = changed(&scene);
    let new = written(&scene, &sh);
    let again = read(&new).unwrap();
    assert_eq!(again.gaussians.sh, kept(&scene, &sh));
    assert_eq!(
        Gaussians {
            sh: Sh::default(),
            ..again.gaussians.clone()
        },
        Gaussians {
            sh: Sh::default(),
            ..scene.gaussians.clone()
        }
    );
    // What is kept is what was asked for, to single precision, where there is room for it.
    for (i, (kept, asked)) in again.gaussians.sh.coefficients.iter().zip(&sh.coefficients).enumerate() {
        let (row, place) = (i / 48, i % 48);
        match row < ROWS[0] && place >= 12 {
            true => assert_eq!(*kept, 0.0),
            false => assert!((kept - asked).abs() < 1e-6, "{i}: {kept}, not {asked}"),
        }
    }
    let mut colours = Vec::new();
    for row in 0..ROWS[0] {
        colours.extend(colour_at(0, row, 0)..colour_at(0, row, 4));
    }
    colours.extend(colour_at(1, 0, 0)..colour_at(1, 0, 16));
    let differ = differences(&file, &new);
    assert!(differ.len() > 500, "{}", differ.len());
    assert!(differ.iter().all(|i| colours.contains(i)));
    // And back again.
    assert!(written(&again, &scene.gaussians.sh).len() == file.len());
}

#[test]
fn only_bands_that_changed_are_written() {
    let file = asset();
    let scene = read(&file).unwrap();
    // The constant term of row 2, and band 2 of row 6, which is row 1 of the second primitive.
    let mut sh = scene.gaussians.sh.clone();
    sh.coefficients[2 * 48 + 1] += 0.25;
    sh.coefficients[6 * 48 + 14] += 0.25;
    let new = written(&scene, &sh);
    let constant = colour_at(0, 2, 0)..colour_at(0, 2, 1);
    let band: Vec<_> = (4..9).map(|i| colour_at(1, 1, i)..colour_at(1, 1, i) + 12).collect();
    let differ = differences(&file, &new);
    assert!(differ.iter().any(|i| constant.contains(i)));
    assert!(
        differ
            .iter()
            .all(|i| constant.contains(i) || band.iter().any(|range| range.contains(i)))
    );
    assert_eq!(read(&new).unwrap().gaussians.sh, kept(&scene, &sh));
}

#[test]
fn buffers_in_the_json_are_written_there() {
    let file = text();
    let scene = read(&file).unwrap();
    assert_eq!(scene.gaussians, read(&asset()).unwrap().gaussians);
    let sh = changed(&scene);
    let new = written(&scene, &sh);
    assert_eq!(read(&new).unwrap().gaussians.sh, kept(&scene, &sh));
    let uri = |bytes: &[u8]| {
        let text = String::from_utf8(bytes.to_vec()).unwrap();
        let start = text.find("base64,").unwrap() + 7;
        let end = start + text[start..].find('"').unwrap();
        (
            text[..start].to_string(),
            STANDARD.decode(&text[start..end]).unwrap(),
            text[end..].to_string(),
        )
    };
    let (old, new) = (uri(&file), uri(&new));
    assert_eq!((&old.0, &old.2, old.1.len()), (&new.0, &new.2, new.1.len()));
    // Without padding it stays so.
    let bare = String::from_utf8(file).unwrap().replace("=\",\"name\"", "\",\"name\"");
    let bare = bare.replace("=\",\"name\"", "\",\"name\"");
    let scene = read(bare.as_bytes()).unwrap();
    let new = String::from_utf8(written(&scene, &sh)).unwrap();
    assert_eq!((new.len(), new.contains('=')), (bare.len(), false));
}

#[test]
fn files_without_turns_keep_colours_exactly() {
    let scene = crate::convert::tests::random(40, 3, 72);
    for format in [Format::Gltf, Format::Glb] {
        let mut file = Vec::new();
        crate::convert::convert(&scene, format, Path::new("it"), &mut file).unwrap();
        let scene = read(&file).unwrap();
        assert!(scene.exact());
        let sh = changed(&scene);
        assert_eq!(read(&written(&scene, &sh)).unwrap().gaussians.sh, sh);
    }
}

#[test]
fn bad_rows_stay_as_they_are() {
    let mut bytes = buffer();
    // NaN as the x of row 1 of the first, and an opacity of 2 in row 4.
    bytes[FIRST + STRIDE..FIRST + STRIDE + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    bytes[FIRST + 4 * STRIDE + 40..][..4].copy_from_slice(&2f32.to_le_bytes());
    let file = glb(&json(None), &bytes);
    assert_eq!(
        read(&file).unwrap_err(),
        "primitive 1 of mesh 0: POSITION of splat 1 is NaN"
    );
    let scene = read_with(&file, BadRows::Ignore).unwrap();
    assert_eq!((scene.gaussians.len(), scene.ignored().unwrap().count()), (6, 2));
    assert_eq!(written(&scene, &scene.gaussians.sh), file);
    let sh = changed(&scene);
    let new = written(&scene, &sh);
    for row in [1, 4] {
        let range = buffer_start(&file) + FIRST + row * STRIDE..buffer_start(&file) + FIRST + (row + 1) * STRIDE;
        assert_eq!(new[range.clone()], file[range]);
    }
    assert_eq!(
        read_with(&new, BadRows::Ignore).unwrap().gaussians.sh,
        kept(&scene, &sh)
    );
}
