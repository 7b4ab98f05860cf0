//! Random scenes: converted, read back, converted again, and marked.
use super::*;
use crate::MAX_DEGREE;

#[test]
fn every_number_is_within_its_step() {
    for degree in 0..=MAX_DEGREE {
        for rows in [1, 2, 255, 256, 257, 900] {
            let scene = random(rows, degree, (100 * degree + rows) as u64);
            for format in Format::ALL {
                checked(&scene, format);
            }
        }
    }
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let scene = random(500, 2, 1);
    for format in Format::ALL {
        let (a, b) = (converted(&scene, format), converted(&scene, format));
        assert!(a.bytes == b.bytes && a.written == b.written, "{format:?}");
    }
}

/// What was read is on the steps of the format already.
#[test]
fn a_second_conversion_changes_next_to_nothing() {
    let scene = random(900, 3, 2);
    for format in Format::ALL {
        let first = converted(&scene, format).scene.gaussians;
        let file = checked(&first, format);
        let second = &file.scene.gaussians;
        let first = reordered(&first, &file.written.order, second.sh.degree);
        let exact = |what: &str, same: bool| assert!(same, "{what} of {format:?}");
        let logits = |scene: &Gaussians| scene.opacity_logits.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        // Single precision has more numbers for small opacities than for their logits, and fewer for large ones.
        if !matches!(format, Format::Gltf | Format::Glb) {
            exact("opacity", logits(&first) == logits(second));
        }
        // Chunks may have other Gaussians once their positions have moved, and other ranges.
        if format != Format::CompressedPly {
            exact("colour", first.sh == second.sh);
            let near = |a: &[f32; 3], b: &[f32; 3]| (0..3).all(|i| a[i] == b[i] || (a[i] - b[i]).abs() < 1e-5);
            let mut scales = first.log_scales.iter().zip(&second.log_scales);
            exact("scales", scales.all(|(a, b)| near(a, b)));
        }
        if !matches!(format, Format::CompressedPly | Format::Sog) {
            exact("positions", first.positions == second.positions);
        }
    }
}

/// Files take marks as those of other programs do.
#[test]
fn written_files_can_be_marked() {
    for format in Format::ALL {
        let scene = converted(&random(600, 2, 3), format).scene;
        let mut sh = scene.gaussians.sh.clone();
        let each = sh.per_gaussian();
        let learnable = 3 * (scene.learnable_degree() + 1).pow(2);
        for (row, colour) in sh.coefficients.chunks_exact_mut(each).enumerate() {
            for (place, value) in colour[..learnable].iter_mut().enumerate() {
                *value += if (row + place) % 2 == 0 { 0.05 } else { -0.05 };
            }
            scene.quantize_colors(row, colour);
        }
        assert_ne!(sh, scene.gaussians.sh);
        let mut bytes = Vec::new();
        scene.encode(&sh, &mut bytes).unwrap();
        let marked = Scene::parse(Path::new("test"), &bytes).unwrap();
        assert!(marked.gaussians.sh == sh, "{format:?}");
        assert_eq!(marked.gaussians.positions, scene.gaussians.positions);
        assert_eq!((marked.format(), marked.gaussians.len()), (format, 600));
    }
}

#[test]
fn files_appear_whole() {
    let folder = tempfile::tempdir().unwrap();
    let scene = random(40, 1, 4);
    for format in Format::ALL {
        let path = folder.path().join(format!("scene.{}", format.extension()));
        let written = convert_to(&scene, format, &path).unwrap();
        let file = converted(&scene, format);
        assert_eq!((Format::of(&path).unwrap(), &written), (format, &file.written));
        assert!(std::fs::read(&path).unwrap() == file.bytes);
    }
    let nowhere = convert_to(&scene, Format::Sog, &folder.path().join("none/scene.sog"));
    assert!(matches!(nowhere, Err(Error::Io { .. })));
    struct Full;
    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    for format in Format::ALL {
        let error = convert(&scene, format, Path::new("a.b"), &mut Full).unwrap_err();
        assert!(matches!(error, Error::Io { path, .. } if path == Path::new("a.b")));
    }
}
