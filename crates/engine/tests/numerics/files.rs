//! Scene files at their extremes: what must come of them, phrase by phrase.
mod ply;

use std::path::Path;

use guardsplat_engine::scene::{BadRows, Scene, Sh};
use guardsplat_engine::splat::{CpuRasterizer, Rasterizer, WeightCache, prepare, sh};
use guardsplat_engine::view::{Split, ViewSampler};
use ply::{ENCODINGS, Encoding, File, RESTS};

fn read(bytes: &[u8]) -> Scene {
    Scene::parse(Path::new("it.ply"), bytes).unwrap()
}

fn refused(bytes: &[u8]) -> String {
    Scene::parse(Path::new("it.ply"), bytes).unwrap_err().to_string()
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut out = Vec::new();
    scene.encode(sh, &mut out).unwrap();
    out
}

/// Writes the scene of a file with another colour for a row, which must be the only thing that changes.
fn changes_nothing_else(file: &File, scene: &Scene, row: usize) {
    assert!(written(scene, &scene.gaussians.sh) == file.bytes());
    let mut sh = scene.gaussians.sh.clone();
    let at = row * sh.per_gaussian() + 1;
    sh.coefficients[at] = -0.75;
    let mut expected = file.clone();
    expected.set(row, "f_dc_1", -0.75);
    assert!(written(scene, &sh) == expected.bytes());
}

/// A picture of the scene from a view of its own.
fn picture(scene: &Scene) -> Vec<f32> {
    let camera = ViewSampler::new(&scene.gaussians, 1)
        .unwrap()
        .camera(Split::HeldOut, 0, 48);
    let view = prepare(&scene.gaussians, &camera, WeightCache::None).unwrap();
    let colours = sh::colours(&scene.gaussians.sh, None, &view);
    CpuRasterizer.render(&view, &colours, [0.0; 3]).unwrap().pixels
}

pub fn nan_anywhere() {
    for encoding in ENCODINGS {
        let good = File::new(encoding, 4, 9);
        for name in &good.names {
            let mut file = good.clone();
            file.set(2, name, f32::NAN);
            let reason = refused(&file.bytes());
            assert!(reason.contains(&format!("property {name} of row 2 is NaN")), "{reason}");

            let scene = Scene::parse_with(Path::new("it.ply"), &file.bytes(), BadRows::Ignore).unwrap();
            let ignored = scene.ignored().unwrap();
            assert_eq!((ignored.count(), scene.gaussians.len()), (1, 3));
            assert_eq!(ignored.first(), format!("property {name} of row 2 is NaN"));
            changes_nothing_else(&file, &scene, 1);
        }
    }
}

pub fn a_wrong_f_rest_count() {
    for rest in 0..80 {
        let bytes = File::new(Encoding::Little, 2, rest).bytes();
        if RESTS.contains(&rest) {
            read(&bytes);
        } else {
            let reason = refused(&bytes);
            assert!(
                reason.contains(&format!("{rest} f_rest properties fit no degree")),
                "{reason}"
            );
            assert!(reason.contains("0, 9, 24, 45 or 72"), "{reason}");
        }
    }
    let mut file = File::new(Encoding::Little, 2, 9);
    file.names[14 + 4] = "f_rest_9".into();
    assert!(refused(&file.bytes()).contains("no property f_rest_4"));
}

pub fn truncated_body() {
    for encoding in [Encoding::Little, Encoding::Big] {
        let file = File::new(encoding, 5, 9);
        let (bytes, header, row) = (file.bytes(), file.header().len(), 4 * file.names.len());
        for length in header..bytes.len() {
            let there = (length - header) / row;
            let reason = refused(&bytes[..length]);
            let words = format!("truncated body: {there} of the 5 Gaussians that the header promises are there");
            assert!(reason.ends_with(&words), "{reason}");
        }
    }
    // Where numbers are words, one that is cut off may be a number still; a row that is missing is not.
    let file = File::new(Encoding::Ascii, 5, 9);
    let (bytes, header) = (file.bytes(), file.header().len());
    for length in (header..bytes.len()).filter(|length| bytes[length - 1] == b'\n') {
        let reason = refused(&bytes[..length]);
        assert!(
            reason.contains("truncated body") && reason.contains("the 5 Gaussians"),
            "{reason}"
        );
    }
}

pub fn promises() {
    let many = format!("1{}", "0".repeat(23));
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 3, 0);
        file.promised = many.clone();
        let reason = refused(&file.bytes());
        assert!(
            reason.contains(&format!("element vertex: a count of {many} is beyond the limit")),
            "{reason}"
        );
        for promised in ["400000000", "18446744073709551615"] {
            file.promised = promised.into();
            let reason = refused(&file.bytes());
            assert!(
                reason.contains("truncated body") && reason.contains(promised),
                "{reason}"
            );
        }
        let mut bare = File::new(encoding, 0, 0);
        bare.names.clear();
        bare.promised = "400000000".into();
        assert!(refused(&bare.bytes()).contains("element vertex has no property x"));
        // Before the Gaussians such rows leave in doubt where these are.
        let mut before = File::new(encoding, 3, 0);
        before.before = "element nothing 400000000\n";
        let reason = refused(&before.bytes());
        assert!(
            reason.contains("element nothing before vertex") && reason.contains("no properties"),
            "{reason}"
        );
    }
}

pub fn ascii_and_big_endian() {
    let expected = read(&File::new(Encoding::Little, 4, 24).bytes()).gaussians;
    for encoding in ENCODINGS {
        let file = File::new(encoding, 4, 24);
        let scene = read(&file.bytes());
        assert_eq!(scene.gaussians, expected, "{encoding:?}");
        changes_nothing_else(&file, &scene, 3);
    }
}

pub fn extras_are_kept() {
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 4, 9);
        file.before = "comment  by\thand, \u{e9}\nobj_info kept\nelement camera 0\nproperty double k\n";
        // Rows in no order, among the used properties one that nobody uses, of which NaN is as good as any value.
        file.rows.swap(0, 3);
        file.names.insert(5, "nx".into());
        file.rows.iter_mut().for_each(|row| row.insert(5, f32::NAN));
        let scene = read(&file.bytes());
        assert_eq!(scene.gaussians.positions[0], [2.0, 0.75, 1.5]);
        changes_nothing_else(&file, &scene, 2);
        // And what follows the Gaussians.
        let longer = [file.bytes(), b"3 0 1 2\n".to_vec()].concat();
        let scene = read(&longer);
        assert!(written(&scene, &scene.gaussians.sh) == longer);
    }
}

pub fn crlf_headers() {
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 4, 9);
        let plain = read(&file.bytes()).gaussians;
        file.newline = "\r\n";
        let scene = read(&file.bytes());
        assert_eq!(scene.gaussians, plain);
        changes_nothing_else(&file, &scene, 0);
    }
}

pub fn zero_quaternions() {
    let mut file = File::new(Encoding::Little, 6, 9);
    for row in 0..6 {
        (0..4).for_each(|i| file.set(row, &format!("rot_{i}"), 0.0));
    }
    let scene = read(&file.bytes());
    assert_eq!(scene.gaussians.rotations, [[0.0; 4]; 6]);
    changes_nothing_else(&file, &scene, 5);
    let pixels = picture(&scene);
    assert!(pixels.iter().all(|value| value.is_finite()));
    assert!(pixels.iter().any(|value| *value > 0.0), "they are drawn");
}

pub fn none_or_one() {
    for encoding in ENCODINGS {
        let none = File::new(encoding, 0, 9);
        let scene = read(&none.bytes());
        assert!(scene.gaussians.is_empty());
        assert!(written(&scene, &scene.gaussians.sh) == none.bytes());
        let reason = ViewSampler::new(&scene.gaussians, 1).err().unwrap().to_string();
        assert!(reason.contains("no Gaussians"), "{reason}");

        let one = File::new(encoding, 1, 9);
        let scene = read(&one.bytes());
        changes_nothing_else(&one, &scene, 0);
        let pixels = picture(&scene);
        assert!(pixels.iter().all(|value| value.is_finite()) && pixels.iter().any(|value| *value > 0.0));
    }
}

pub fn degrees() {
    for encoding in ENCODINGS {
        for (degree, rest) in RESTS.into_iter().enumerate() {
            let file = File::new(encoding, 3, rest);
            let scene = read(&file.bytes());
            let sh = &scene.gaussians.sh;
            assert_eq!(
                (sh.degree, sh.per_gaussian(), scene.learnable_degree()),
                (degree, 3 + rest, degree)
            );
            // Row 1 of the file: three constants, then a channel after the other; in memory the channels alternate.
            let row = &sh.coefficients[sh.per_gaussian()..][..sh.per_gaussian()];
            assert_eq!(row[..3], [0.5, -0.25, 1.0]);
            for (place, value) in row[3..].iter().enumerate() {
                let property = (place % 3) * (rest / 3) + place / 3;
                assert_eq!(*value, 0.125 * (property + 2) as f32, "degree {degree}, {place}");
            }
            changes_nothing_else(&file, &scene, 2);
        }
    }
}
