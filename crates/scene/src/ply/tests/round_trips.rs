//! What is read is what is written, and a write changes colours only.
use super::*;

#[test]
fn all_encodings_and_degrees_round_trip() {
    for encoding in ENCODINGS {
        for degree in 0..=MAX_DEGREE {
            for newline in ["\n", "\r\n"] {
                let mut file = File::new(encoding, degree, 3);
                file.newline = newline;
                let scene = file.read().unwrap();
                let g = &scene.gaussians;
                assert_eq!((g.len(), g.sh.degree), (3, degree));
                let value = |name: &str| file.rows[1][file.column(name)] as f32;
                assert_eq!(g.positions[1], ["x", "y", "z"].map(value));
                assert_eq!(g.rotations[1], ["rot_0", "rot_1", "rot_2", "rot_3"].map(value));
                assert_eq!(g.log_scales[1], ["scale_0", "scale_1", "scale_2"].map(value));
                assert_eq!(g.opacity_logits[1], value("opacity"));
                let colour = &g.sh.coefficients[g.sh.per_gaussian()..2 * g.sh.per_gaussian()];
                assert_eq!(colour[..3], ["f_dc_0", "f_dc_1", "f_dc_2"].map(value));
                if degree > 0 {
                    let channel = rest_count(degree) / 3;
                    assert_eq!(colour[4], value(&format!("f_rest_{channel}")), "green, first rest");
                    assert_eq!(*colour.last().unwrap(), value(&format!("f_rest_{}", 3 * channel - 1)));
                }
                assert_eq!(written(&scene, &g.sh), file.bytes());
            }
        }
    }
}

#[test]
fn a_write_changes_colours_and_nothing_else() {
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 1, 4)
            .add("id", "int", 7.0)
            .add("flag", "uchar", 3.0);
        if encoding == Encoding::Ascii {
            file.before = (
                "element camera 1\nproperty list uchar float k\n".into(),
                b"2 0.5 0.5\n".into(),
            );
            file.after = (
                "element face 1\nproperty list uchar int i\n".into(),
                b"\n3 0 1 2".into(),
            );
        } else {
            file.before = (
                "element camera 2\nproperty uchar a\nproperty double b\n".into(),
                vec![9; 18],
            );
            file.after = ("element face 1\nproperty list uchar int i\n".into(), b"anything".into());
        }
        let scene = file.read().unwrap();
        let mut sh = scene.gaussians.sh.clone();
        let k = sh.per_gaussian();
        sh.coefficients[2 * k + 4] = 1e-9; // row 2, green, first rest: f_rest_3 of degree 1
        sh.coefficients[1] = -0.5; // row 0, green, DC
        let expected = file.with("f_rest_3", 2, f64::from(1e-9f32)).with("f_dc_1", 0, -0.5);
        let again = read(&written(&scene, &sh)).unwrap();
        assert_eq!(again.gaussians, expected.read().unwrap().gaussians);
        assert_eq!(again.gaussians.sh, sh);
        if encoding != Encoding::Ascii {
            assert_eq!(written(&scene, &sh), expected.bytes());
        }
    }
}

#[test]
fn doubles_keep_the_digits_that_single_precision_lacks() {
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 0, 2)
            .with("f_dc_0", 0, 0.1)
            .with("f_dc_1", 1, 1.0 / 3.0);
        file.names.iter_mut().for_each(|(_, kind)| *kind = "double");
        let scene = file.read().unwrap();
        assert_eq!(scene.gaussians.sh.coefficients[0], 0.1);
        assert_eq!(written(&scene, &scene.gaussians.sh), file.bytes());
        let mut sh = scene.gaussians.sh.clone();
        sh.coefficients[0] = 0.75;
        let bytes = written(&scene, &sh);
        assert_eq!(bytes, file.with("f_dc_0", 0, 0.75).bytes());
    }
}

#[test]
fn a_scene_made_in_memory_comes_back_from_its_file() {
    for degree in 0..=MAX_DEGREE {
        let scene = File::new(Encoding::Big, degree, 2).read().unwrap();
        let made = Scene::from_gaussians(scene.gaussians.clone());
        let bytes = written(&made, &scene.gaussians.sh);
        assert_eq!(read(&bytes).unwrap().gaussians, scene.gaussians);
    }
}

#[test]
fn real_scenes_come_back_byte_for_byte() {
    for name in ["playbot_8k.ply", "pod.ply", "donut.ply"] {
        let Some(path) = crate::testing::scene_path(name) else {
            return;
        };
        let scene = Scene::read(&path).unwrap();
        assert!(
            written(&scene, &scene.gaussians.sh) == std::fs::read(path).unwrap(),
            "{name}"
        );
    }
}

#[test]
fn zero_and_one_gaussian_are_read() {
    for encoding in ENCODINGS {
        for rows in [0, 1] {
            assert_eq!(File::new(encoding, 3, rows).read().unwrap().gaussians.len(), rows);
        }
    }
}

/// Tools pad: a file of degree 3 with nothing in its third band is a scene of degree 2.
#[test]
fn bands_of_zeros_are_in_the_file_only() {
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 3, 3);
        for i in 0..45 {
            if i % 15 >= 8 {
                (0..3).for_each(|row| {
                    file =
                        std::mem::replace(&mut file, File::new(encoding, 0, 0)).with(&format!("f_rest_{i}"), row, 0.0)
                });
            }
        }
        let scene = file.read().unwrap();
        assert_eq!((scene.gaussians.sh.degree, scene.learnable_degree()), (2, 2));
        assert_eq!(scene.gaussians.sh.coefficients.len(), 3 * 27);
        assert_eq!(written(&scene, &scene.gaussians.sh), file.bytes());
        // Blue's last coefficient of the second band is f_rest_37.
        let mut sh = scene.gaussians.sh.clone();
        sh.coefficients[27 + 26] = 0.5;
        let expected = file.with("f_rest_37", 1, 0.5);
        assert_eq!(
            read(&written(&scene, &sh)).unwrap().gaussians,
            expected.read().unwrap().gaussians
        );
    }
    let Some(path) = crate::testing::scene_path("playbot_8k.ply") else {
        return;
    };
    let scene = Scene::read(&path).unwrap();
    assert_eq!(scene.gaussians.sh.degree, 2, "stored as degree 3");
}
