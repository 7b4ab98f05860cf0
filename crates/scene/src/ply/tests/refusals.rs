//! Every kind of bad file has its message.
use super::*;

#[test]
fn values_that_are_not_numbers_are_named() {
    for encoding in ENCODINGS {
        for name in ["x", "f_dc_1", "f_rest_7", "opacity", "scale_2", "rot_0"] {
            let reason = File::new(encoding, 1, 3).with(name, 2, f64::NAN).refused();
            assert!(reason.contains(&format!("{name} of row 2 is NaN")), "{reason}");
        }
        let legal = [
            ("opacity", f64::INFINITY),
            ("opacity", f64::NEG_INFINITY),
            ("scale_1", f64::NEG_INFINITY),
        ];
        for (name, value) in legal {
            let file = File::new(encoding, 0, 1).with(name, 0, value);
            let scene = file.read().unwrap();
            assert_eq!(written(&scene, &scene.gaussians.sh), file.bytes());
        }
        for (name, value) in [
            ("scale_1", f64::INFINITY),
            ("y", f64::NEG_INFINITY),
            ("f_dc_0", f64::INFINITY),
        ] {
            let reason = File::new(encoding, 0, 1).with(name, 0, value).refused();
            assert!(reason.contains(&format!("{name} of row 0 is")), "{reason}");
        }
        // A property that nobody uses may be anything.
        File::new(encoding, 0, 1).add("nx", "float", f64::NAN).read().unwrap();
    }
}

#[test]
fn wrong_properties_are_named() {
    let file = || File::new(Encoding::Little, 1, 1);
    let reason = file().without("f_rest_8").refused();
    assert!(reason.starts_with("8 f_rest properties"), "{reason}");
    let reason = file().without("f_rest_4").add("f_rest_12", "float", 0.0).refused();
    assert!(reason.contains("no property f_rest_4"), "{reason}");
    assert!(file().without("scale_1").refused().contains("no property scale_1"));
    assert!(
        file()
            .without("x")
            .add("x", "int", 0.0)
            .refused()
            .contains("property x is Int")
    );
    assert!(
        file()
            .add("x", "float", 0.0)
            .refused()
            .contains("two properties of the same name")
    );
    let text = file().header().replace("float opacity", "list uchar float opacity");
    assert!(refused(text.as_bytes()).contains("property opacity of element vertex is a list"));
}

#[test]
fn headers_that_promise_too_much_cost_nothing() {
    for encoding in ENCODINGS {
        let promise = |count: &str| {
            let mut file = File::new(encoding, 3, 1);
            file.promised = Some(count.to_string());
            file.refused()
        };
        let reason = promise("100000000000000000000000");
        assert!(
            reason.contains("100000000000000000000000 is beyond the limit"),
            "{reason}"
        );
        for count in ["2", "18446744073709551615", "4000000000"] {
            let reason = promise(count);
            assert!(reason.contains("truncated") && reason.contains(count), "{reason}");
        }
        let mut bare = File::new(encoding, 0, 0);
        bare.names.clear();
        bare.promised = Some("400000000".into());
        assert!(bare.refused().contains("no property x"));
        let mut before = File::new(encoding, 0, 1);
        before.before.0 = "element nothing 400000000\n".into();
        assert!(before.refused().contains("nothing"));
    }
    let endless: Vec<u8> = b"ply\n"
        .iter()
        .copied()
        .chain(std::iter::repeat_n(b'c', 1 << 20))
        .collect();
    assert!(refused(&endless).contains("first 65536 bytes"));
}

#[test]
fn truncated_bodies_say_how_much_is_there() {
    for encoding in ENCODINGS {
        let bytes = File::new(encoding, 0, 10).bytes();
        let reason = refused(&bytes[..bytes.len() - 1 - bytes.len() / 10]);
        assert!(
            reason.contains("truncated") && reason.contains("the 10 Gaussians"),
            "{reason}"
        );
    }
    let bytes = File::new(Encoding::Little, 0, 10).bytes();
    assert!(refused(&bytes[..bytes.len() - 57]).contains("8 of the 10"));
    assert!(refused(b"ply\nformat ascii 1.0\n").contains("before end_header"));
}

#[test]
fn other_files_are_refused() {
    for (text, expected) in [
        (
            "",
            "neither a PLY, plain or compressed, nor an SPZ, a SOG, a glTF, a .ksplat or a .splat, since it is empty",
        ),
        (
            "Dear reader,\nthis is prose.\n",
            "neither a PLY, plain or compressed, nor an SPZ, a SOG, a glTF, a .ksplat or a .splat",
        ),
        ("ply", "ends before end_header"),
        ("ply is a word\n", "not a PLY file: its first line is not \"ply\""),
    ] {
        let reason = refused(text.as_bytes());
        assert!(reason.contains(expected), "{reason}");
    }
    assert!(refused(b"ply\nformat ascii 1.0\nnonsense\nend_header\n").contains("bad header"));
    assert!(refused(b"ply\nformat ascii 1.0\nend_header\n").contains("no element vertex"));
    let folder = tempfile::tempdir().unwrap();
    assert!(Scene::read(folder.path()).is_err());
    assert!(matches!(
        Scene::read(&folder.path().join("none.ply")),
        Err(Error::Io { .. })
    ));
}

#[test]
fn colours_of_another_scene_are_refused_and_nothing_is_written() {
    let scene = File::new(Encoding::Little, 1, 2).read().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.ply");
    let other = Sh {
        degree: 0,
        coefficients: vec![0.0; 6],
    };
    assert!(scene.write(&path, &other).is_err());
    let mut poisoned = scene.gaussians.sh.clone();
    poisoned.coefficients[13] = f32::NAN;
    let error = scene.write(&path, &poisoned).unwrap_err().to_string();
    assert!(error.contains("row 1"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
