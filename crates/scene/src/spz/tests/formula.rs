//! What bytes mean, against numbers from the published format.
use super::*;
use crate::Gaussians;
use std::f32::consts::FRAC_1_SQRT_2;

fn one(version: u32, degree: u8, sections: [&[u8]; 6]) -> Gaussians {
    File::one(version, degree, sections).read().unwrap().gaussians
}

#[test]
fn positions_are_signed_with_24_bits() {
    // 1 and -1 in the last place, and the least: little-endian.
    let positions = [1, 0, 0, 0xff, 0xff, 0xff, 0, 0, 0x80];
    for version in VERSIONS {
        let sections: [&[u8]; 6] = [&positions, &[0], &[0; 3], &[0; 3], &[0; 4], &[]];
        let mut file = File::one(version, 0, sections);
        if version == 2 {
            file.sections[4].pop();
        }
        let at = |file: &File| file.read().unwrap().gaussians.positions[0];
        assert_eq!(at(&file), [1.0 / 4096.0, -1.0 / 4096.0, -2048.0]);
        file.fractional_bits = 0;
        assert_eq!(at(&file), [1.0, -1.0, -8_388_608.0]);
        file.fractional_bits = 24;
        assert_eq!(at(&file), [1.0 / 16_777_216.0, -1.0 / 16_777_216.0, -0.5]);
    }
}

#[test]
fn scales_are_sixteenths_of_a_logarithm() {
    let g = one(3, 0, [&[0; 9], &[0], &[0; 3], &[0, 160, 255], &[0; 4], &[]]);
    assert_eq!(g.log_scales[0], [-10.0, 0.0, 5.9375]);
}

#[test]
fn alphas_are_opacities() {
    let mut file = File::new(4, 0, 4);
    file.sections[1] = vec![0, 255, 51, 204];
    let g = file.read().unwrap().gaussians;
    // Logits of 0, 1, 0.2 and 0.8.
    let expected = [f32::NEG_INFINITY, f32::INFINITY, -1.386_294_4, 1.386_294_4];
    assert_eq!(g.opacity_logits, expected);
    assert!((g.opacity(2) - 0.2).abs() < 1e-6 && g.opacity(1) > 0.999_999);
}

#[test]
fn rotations_of_version_2_are_x_y_z() {
    let rotation = |bytes: [u8; 3]| one(2, 0, [&[0; 9], &[0], &[0; 3], &[0; 3], &bytes, &[]]).rotations[0];
    assert_eq!(rotation([255, 127, 128])[1..], [1.0, -1.0 / 255.0, 1.0 / 255.0]);
    assert_eq!(rotation([255, 127, 128])[0], 0.0, "longer than 1");
    // 0.6 is (204 - 127.5) / 127.5: w is 0.8.
    let q = rotation([204, 127, 127]);
    assert!((q[0] - 0.8).abs() < 1e-4 && (q[1] - 0.6).abs() < 1e-6, "{q:?}");
    assert!(rotation([0; 3]).iter().all(|v| v.is_finite()));
}

#[test]
fn rotations_since_version_3_are_the_smallest_three() {
    let rotation = |largest: u32, others: [u32; 3]| {
        let bits = largest << 30 | others[0] << 20 | others[1] << 10 | others[2];
        let file = |version| one(version, 0, [&[0; 9], &[0], &[0; 3], &[0; 3], &bits.to_le_bytes(), &[]]);
        assert_eq!(file(3).rotations, file(4).rotations);
        file(3).rotations[0]
    };
    let near = |q: [f32; 4], expected: [f32; 4]| {
        assert!(
            (0..4).all(|i| (q[i] - expected[i]).abs() < 1e-3),
            "{q:?} is not {expected:?}"
        );
    };
    let r = FRAC_1_SQRT_2;
    let negative = 512;
    // In order x, y, z, w without the largest; in memory w is first.
    near(rotation(3, [0, 0, 0]), [1.0, 0.0, 0.0, 0.0]);
    near(rotation(0, [0, 0, 0]), [0.0, 1.0, 0.0, 0.0]);
    near(rotation(0, [0, 0, 511]), [r, r, 0.0, 0.0]);
    near(rotation(2, [negative | 511, 0, 0]), [0.0, -r, 0.0, r]);
    // 0.1, -0.2, 0.3 and what is left, sqrt(0.86), as y: 511 / sqrt(0.5) a unit.
    near(rotation(1, [72, negative | 145, 217]), [0.3, 0.1, 0.927, -0.2]);
    near(rotation(3, [511, 511, 511]), [0.0, r, r, r]);
}

#[test]
fn colours_are_bytes_with_red_green_blue_innermost() {
    let colours = [0, 255, 166];
    let harmonics: Vec<u8> = (0..9).map(|i| [0, 255, 128, 129, 127, 64, 192, 1, 254][i]).collect();
    for version in VERSIONS {
        let rotation: &[u8] = if version == 2 { &[0; 3] } else { &[0; 4] };
        let g = one(version, 1, [&[0; 9], &[0], &colours, &[0; 3], rotation, &harmonics]);
        // A constant term c is the colour 0.5 + 0.15 c: that of 166 is 38.5 / 38.25.
        let expected = [-10.0 / 3.0, 10.0 / 3.0, 38.5 / 38.25];
        assert_eq!(g.sh.degree, 1);
        for (value, expected) in g.sh.coefficients.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
        }
        let rest = [-1.0, 127.0 / 128.0, 0.0, 1.0 / 128.0, -1.0 / 128.0, -0.5, 0.5];
        assert_eq!(g.sh.coefficients[3..10], rest);
        assert_eq!(g.sh.coefficients[10..], [-127.0 / 128.0, 126.0 / 128.0]);
    }
}

#[test]
fn bands_without_anything_are_not_in_memory() {
    for version in VERSIONS {
        for degree in 0..=4u8 {
            // Red of the first coefficient of each band, and blue of the last, of the second Gaussian.
            let places = (0..degree).flat_map(|band| [3 * usize::from(band * (band + 2)), harmonics(band + 1) - 1]);
            for place in places.map(Some).chain([None]) {
                let mut file = File::new(version, degree, 3);
                file.sections[HARMONICS].fill(128);
                let used = place.map_or(0, |place| (1..).find(|band| place < harmonics(*band)).unwrap());
                if let Some(place) = place {
                    file.sections[HARMONICS][harmonics(degree) + place] = 129;
                }
                let scene = file.read().unwrap();
                let sh = &scene.gaussians.sh;
                let row = harmonics(used) + 3;
                assert_eq!(
                    (sh.degree, sh.coefficients.len()),
                    (usize::from(used), 3 * row),
                    "{place:?}"
                );
                assert_eq!(scene.learnable_degree(), usize::from(used));
                if let Some(place) = place {
                    assert_eq!(sh.coefficients[row + 3 + place], 1.0 / 128.0);
                }
                assert_eq!(plain(&written(&scene, sh)), plain(&file.bytes()));
            }
        }
    }
}
