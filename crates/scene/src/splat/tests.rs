//! Tests of files without a header.
mod ignored;

use super::*;
use crate::range::tests::wild;
use crate::summary::tests::agrees;
use crate::{Error, Format, Scene};
use proptest::prelude::*;

/// A row from its numbers, colours with opacity, and rotation.
fn row(numbers: [f32; 6], colour: [u8; 4], rotation: [u8; 4]) -> Vec<u8> {
    let numbers = numbers.iter().flat_map(|v| v.to_le_bytes());
    numbers.chain(colour).chain(rotation).collect()
}

/// A row like those of real files.
fn usual() -> Vec<u8> {
    row([1.0, -2.0, 3.5, 1.0, 0.25, 0.5], [0, 51, 255, 204], [192, 64, 192, 64])
}

fn read(bytes: &[u8]) -> Result<Scene> {
    let scene = Scene::parse(Path::new("test.splat"), bytes)?;
    agrees(bytes, &scene);
    Ok(scene)
}

fn refused(bytes: &[u8]) -> String {
    match read(bytes) {
        Err(Error::BadScene { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut out = Vec::new();
    scene.encode(sh, &mut out).unwrap();
    out
}

#[test]
fn all_bytes_are_read() {
    let flat = row([0.0, 1e9, -1e-40, 0.0, -0.0, 1e9], [1, 2, 3, 0], [128, 255, 0, 128]);
    let opaque = row([0.0; 6], [0, 0, 0, 255], [128, 128, 128, 0]);
    let bytes = [usual(), flat, opaque].concat();
    let scene = read(&bytes).unwrap();
    assert_eq!((scene.format(), scene.exact()), (Format::Splat, false));
    assert_eq!((scene.learnable_degree(), scene.gaussians.sh.degree), (0, 0));
    let g = &scene.gaussians;
    assert_eq!(g.positions, [[1.0, -2.0, 3.5], [0.0, 1e9, -1e-40], [0.0; 3]]);
    assert_eq!(
        g.rotations[..2],
        [[0.5, -0.5, 0.5, -0.5], [0.0, 127.0 / 128.0, -1.0, 0.0]]
    );
    assert_eq!(g.log_scales[0], [0.0, -1.386_294_4, -std::f32::consts::LN_2]);
    assert_eq!(g.log_scales[1], [f32::NEG_INFINITY, f32::NEG_INFINITY, 20.723_266]);
    // 204 is four fifths: ln(4).
    assert_eq!(g.opacity_logits, [1.386_294_4, f32::NEG_INFINITY, f32::INFINITY]);
    // (0, 1/5 and 1, less 1/2) / 0.282_094_79.
    assert_eq!(g.sh.coefficients[..3], [-1.772_453_9, -1.063_472_3, 1.772_453_9]);
    assert!(written(&scene, &g.sh) == bytes);
}

#[test]
fn a_write_changes_colours_and_nothing_else() {
    let bytes = [usual(), usual()].concat();
    let scene = read(&bytes).unwrap();
    let mut sh = scene.gaussians.sh.clone();
    sh.coefficients[4] = 0.5; // 0.5 + 0.282 / 2 of 255: 163.47
    sh.coefficients[5] = 1e30;
    sh.coefficients[0] = -7.0;
    let mut expected = bytes.clone();
    expected[32 + 25] = 163;
    assert!(written(&scene, &sh) == expected);
    let mut row = sh.coefficients[3..].to_vec();
    scene.quantize_colors(1, &mut row);
    assert_eq!(row, read(&expected).unwrap().gaussians.sh.coefficients[3..]);
}

#[test]
fn what_is_no_scene_is_refused_with_a_reason() {
    let unknown =
        "not a scene: neither a PLY, plain or compressed, nor an SPZ, a SOG, a glTF, a .ksplat or a .splat, since ";
    assert_eq!(refused(b""), format!("{unknown}it is empty"));
    assert_eq!(
        refused(&[7; 35]),
        format!("{unknown}its size of 35 bytes is no multiple of 32")
    );
    for length in 1..64 {
        if length != 32 {
            refused(&[usual(), usual()].concat()[..length]);
        }
    }
    for (place, name) in ["x of row 7", "y of row 7", "z of row 7"].iter().enumerate() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut bytes = usual().repeat(9);
            bytes[7 * 32 + 4 * place..][..4].copy_from_slice(&value.to_le_bytes());
            assert_eq!(refused(&bytes), format!("{unknown}{name} is {value}"));
        }
    }
    for axis in 0..3 {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.5, -1e-40] {
            let mut bytes = usual().repeat(9);
            bytes[7 * 32 + 12 + 4 * axis..][..4].copy_from_slice(&value.to_le_bytes());
            assert_eq!(
                refused(&bytes),
                format!("{unknown}the scale of row 7 along axis {axis} is {value}")
            );
        }
    }
}

/// Bytes of other kinds have finite numbers, too, but no rotations.
#[test]
fn zeros_text_and_numbers_are_no_scene() {
    let rotations = "rows have a rotation of length 1";
    assert!(refused(&[0; 3200]).contains("only 0 of 100 rows"));
    let text = "Gaussian splatting is a rasterisation technique for scenes. ".repeat(32);
    assert!(refused(text.as_bytes()).contains(rotations));
    let numbers = "[0.125, 17.25, 0.5, 3.75],\n".repeat(32);
    assert!(refused(numbers.as_bytes()).contains(rotations));
    let floats: Vec<u8> = (0..800).flat_map(|i| (i as f32 * 0.25).to_le_bytes()).collect();
    assert!(refused(&floats).contains(rotations));
    // A few rotations that are none are in no way.
    let still = row([0.0; 6], [9; 4], [128; 4]);
    read(&[usual(), still.clone()].concat()).unwrap();
    assert!(refused(&[usual(), still.clone(), still].concat()).contains("only 1 of 3 rows"));
}

/// Programs that turn point clouds into splats write rotations of any length.
#[test]
fn balls_need_no_rotation() {
    let ball = |size: f32| row([48.0, -46.0, 0.5, size, size, size], [48, 54, 48, 255], [255, 0, 0, 0]);
    let bytes = [ball(0.01), ball(2.0), ball(1e-3)].concat();
    let scene = read(&bytes).unwrap();
    assert_eq!(scene.gaussians.len(), 3);
    assert!(written(&scene, &scene.gaussians.sh) == bytes);
    // A ball has a size, and bytes of one value are none.
    assert!(refused(&ball(0.0)).contains("only 0 of 1 rows"));
    assert!(refused(&[90; 320]).contains("only 0 of 10 rows"));
}

/// A file may begin like a PLY's first word but not like its first line.
#[test]
fn positions_may_spell_words() {
    let mut bytes = usual();
    bytes[..4].copy_from_slice(b"ply?");
    assert_eq!(read(&bytes).unwrap().format(), Format::Splat);
    bytes[..4].copy_from_slice(b"ply\n");
    assert!(refused(&bytes).contains("end_header"));
}

/// The numbers are splat-transform's (2.7.1), but for rotations, which it takes for 255ths and normalises.
#[test]
fn a_real_file_is_what_other_tools_find_in_it() {
    let Some(path) = crate::testing::scene_path("plant.splat") else {
        return;
    };
    let scene = Scene::read(&path).unwrap();
    let g = &scene.gaussians;
    assert_eq!((scene.format(), g.len(), g.sh.degree), (Format::Splat, 113_648, 0));
    assert_eq!(g.positions[0], [-0.131_064_12, -0.409_054_96, -0.063_238_89]);
    assert_eq!(g.log_scales[0], [-5.983_312_6, -7.698_744, -4.433_215]);
    assert_eq!(g.opacity_logits[0], -3.308_107);
    assert_eq!(g.sh.coefficients[..3], [1.772_453_9, 1.772_453_9, 1.494_421_8]);
    assert_eq!(g.positions[100_000], [0.079_038_25, 0.451_055, 0.159_988_46]);
    let expected = [
        [0.848_355_6, -0.301_029_38, 0.121_193_655, 0.418_313_56],
        [0.621_758_2, -0.770_354_5, 0.136_865_02, 0.035_193_86],
    ];
    for (row, expected) in [0, 100_000].into_iter().zip(expected) {
        for (found, expected) in g.rotations[row].into_iter().zip(expected) {
            assert!((found - expected).abs() < 0.008, "{row}: {found} {expected}");
        }
    }
    assert!(written(&scene, &g.sh) == std::fs::read(&path).unwrap());
    let mut own = g.sh.clone();
    own.coefficients
        .chunks_exact_mut(3)
        .enumerate()
        .for_each(|(i, colour)| scene.quantize_colors(i, colour));
    assert_eq!(own, g.sh);
}

proptest! {
    #[test]
    fn what_is_kept_comes_back(
        colours in prop::collection::vec(any::<[u8; 4]>(), 1..9),
        changes in prop::collection::vec(wild(), 27),
    ) {
        let bytes: Vec<u8> = colours.iter().flat_map(|c| row([1.0; 6], *c, [255, 128, 128, 128])).collect();
        let scene = read(&bytes).unwrap();
        prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);
        let mut sh = Sh { degree: 0, coefficients: changes[..3 * colours.len()].to_vec() };
        let out = written(&scene, &sh);
        let again = read(&out).unwrap().gaussians;
        for _twice in 0..2 {
            sh.coefficients.chunks_exact_mut(3).enumerate().for_each(|(i, colour)| scene.quantize_colors(i, colour));
            let bits = |sh: &Sh| sh.coefficients.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&sh), bits(&again.sh));
        }
        for (old, new) in bytes.chunks(32).zip(out.chunks(32)) {
            prop_assert_eq!(&old[..24], &new[..24]);
            prop_assert_eq!(&old[27..], &new[27..]);
        }
    }

    #[test]
    fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..20), rows in 0..4usize) {
        let _ = read(&bytes.repeat(32));
        let mut damaged = usual().repeat(rows);
        for (i, byte) in bytes.iter().enumerate() {
            let places = damaged.len().max(1);
            if let Some(place) = damaged.get_mut(i * 37 % places) {
                *place = *byte;
            }
        }
        let ignoring = Scene::parse_with(Path::new("it"), &damaged, crate::BadRows::Ignore);
        for scene in [read(&damaged), ignoring].into_iter().flatten() {
            prop_assert!(written(&scene, &scene.gaussians.sh) == damaged);
        }
    }
}
