//! Stand-ins against files: converted, read back, and put into the order of the scene.
use super::*;
use crate::alter::{ShNoise, add_sh_noise};
use crate::convert::convert;
use crate::convert::tests::random;
use crate::testing::scene_path;
use crate::{MAX_DEGREE, Scene};

/// Coefficients of a converted scene, in the order and with the bands of the one that was converted.
fn converted(scene: &Gaussians, format: Format) -> Vec<f32> {
    let mut bytes = Vec::new();
    let written = convert(scene, format, Path::new("test"), &mut bytes).unwrap();
    let read = Scene::parse(Path::new("test"), &bytes).unwrap().gaussians;
    let (each, there) = (scene.sh.per_gaussian(), read.sh.per_gaussian());
    let mut all = vec![0.0; scene.sh.coefficients.len()];
    for (i, row) in written.order.iter().enumerate() {
        all[row * each..row * each + there].copy_from_slice(&read.sh.coefficients[i * there..(i + 1) * there]);
    }
    all
}

fn applied(kept: &ColorQuantizer, scene: &Gaussians) -> Vec<f32> {
    let rows: Vec<usize> = (0..scene.len()).collect();
    let mut coefficients = scene.sh.coefficients.clone();
    kept.apply(&rows, &mut coefficients).unwrap();
    coefficients
}

fn noisy(scene: &Gaussians, seed: u64) -> Gaussians {
    let noise = ShNoise {
        constant: 0.05,
        rest: 0.02,
    };
    add_sh_noise(scene, noise, seed).unwrap()
}

/// Root of the mean square of differences.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn stand_ins_are_what_files_keep() {
    for degree in 0..=MAX_DEGREE {
        let scene = random(700, degree, 10 + degree as u64);
        for format in Format::ALL {
            let kept = ColorQuantizer::fit(&scene, format).unwrap();
            assert!(
                applied(&kept, &scene) == converted(&scene, format),
                "{format:?} of degree {degree}"
            );
            if format != Format::Sog {
                let changed = noisy(&scene, 1);
                let file = converted(&changed, format);
                assert!(
                    applied(&kept, &changed) == file,
                    "{format:?} of degree {degree}, changed"
                );
            }
        }
    }
}

#[test]
fn real_scenes_too() {
    for name in ["playbot_8k.ply", "donut.ply"] {
        let Some(path) = scene_path(name) else { return };
        let scene = Scene::read(&path).unwrap().into_gaussians();
        let changed = noisy(&scene, 2);
        for format in [Format::CompressedPly, Format::Spz, Format::Splat] {
            let kept = ColorQuantizer::fit(&scene, format).unwrap();
            // Bands that a reader drops are half a step from 0.
            let limit = if format == Format::CompressedPly {
                1.0 / 64.0
            } else {
                0.0
            };
            for scene in [&scene, &changed] {
                let (a, b) = (applied(&kept, scene), converted(scene, format));
                assert!(
                    a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= limit),
                    "{format:?} of {name}"
                );
            }
        }
        let kept = ColorQuantizer::fit(&scene, Format::Sog).unwrap();
        assert!(applied(&kept, &scene) == converted(&scene, Format::Sog), "{name}");
        // Groups and codebooks of the changed scene are others; what they leave of the change is about the same.
        let original = converted(&scene, Format::Sog);
        let (stand_in, file) = (applied(&kept, &changed), converted(&changed, Format::Sog));
        let share = |kept: &[f32], places: &dyn Fn(usize) -> bool| {
            let (mut product, mut square) = (0.0, 0.0);
            for i in (0..kept.len()).filter(|i| places(i % scene.sh.per_gaussian())) {
                let change = f64::from(changed.sh.coefficients[i] - scene.sh.coefficients[i]);
                product += change * f64::from(kept[i] - original[i]);
                square += change * change;
            }
            product / square
        };
        let constants = |place| place < 3;
        let rests = |place| place >= 3;
        let shares = [share(&stand_in, &constants), share(&file, &constants)];
        assert!((shares[0] - shares[1]).abs() < 0.05, "{name}: {shares:?}");
        if scene.sh.degree > 0 {
            let shares = [share(&stand_in, &rests), share(&file, &rests)];
            assert!((shares[0] - shares[1]).abs() < 0.1, "{name}: {shares:?}");
        }
    }
}

#[test]
fn some_rows_are_as_all_with_the_others_unchanged() {
    let scene = random(900, 2, 30);
    let changed = noisy(&scene, 3);
    let rows: Vec<usize> = (0..900).filter(|row| row % 3 != 1).rev().collect();
    let each = scene.sh.per_gaussian();
    let mut mixed = scene.clone();
    let mut some = Vec::new();
    for row in &rows {
        let own = &changed.sh.coefficients[row * each..(row + 1) * each];
        mixed.sh.coefficients[row * each..(row + 1) * each].copy_from_slice(own);
        some.extend(own);
    }
    for format in Format::ALL {
        let kept = ColorQuantizer::fit(&scene, format).unwrap();
        let all = applied(&kept, &mixed);
        let mut some = some.clone();
        kept.apply(&rows, &mut some).unwrap();
        for (row, found) in rows.iter().zip(some.chunks(each)) {
            let expected = &all[row * each..(row + 1) * each];
            // Sums over a group in another order are another in their last digit.
            let same = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(
                same || format == Format::Sog && apart(found, expected) < 1e-2,
                "{format:?} {row}"
            );
        }
    }
}

#[test]
fn rows_and_lengths_are_checked() {
    let scene = random(4, 1, 31);
    let kept = ColorQuantizer::fit(&scene, Format::Sog).unwrap();
    let reason = |rows: &[usize], count| kept.apply(rows, &mut vec![0.0; count]).unwrap_err().to_string();
    assert!(reason(&[0, 4], 24).contains("row 4 of a scene of 4"));
    assert!(reason(&[0], 24).contains("24 coefficients for 1 rows, must be 12"));
    kept.apply(&[], &mut []).unwrap();
    // What is learned may have become nothing at all; that is for others to say.
    for format in Format::ALL {
        let kept = ColorQuantizer::fit(&scene, format).unwrap();
        kept.apply(&[1], &mut [f32::NAN; 12]).unwrap();
        kept.apply(&[2], &mut [f32::INFINITY; 12]).unwrap();
    }
    let mut bad = scene.clone();
    bad.sh.coefficients[13] = f32::NAN;
    assert!(
        ColorQuantizer::fit(&bad, Format::Spz)
            .unwrap_err()
            .to_string()
            .contains("row 1")
    );
    ColorQuantizer::fit(&Gaussians::default(), Format::Sog).unwrap();
}
