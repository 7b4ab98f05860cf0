//! What is kept is what comes back, and a write changes colours only.
use super::*;
use proptest::prelude::*;

/// Any finite number, and many that are near those of colours.
fn value() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -4.0f32..4.0,
        2 => any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |v| v.is_finite()),
        1 => prop::sample::select(vec![
            0.0, -0.0, 1e30, -1e30, f32::MAX, f32::MIN, f32::MIN_POSITIVE, 1e-45, -1e-45, 0.5, 1.0, -1.0,
            10.0 / 3.0, -10.0 / 3.0, 0.003_906_25, 0.003_906_249_8, -0.003_906_25, 0.013_071_895,
        ]),
    ]
}

proptest! {
    /// The contract of containers, bit by bit.
    #[test]
    fn what_is_kept_is_what_comes_back(
        version in prop::sample::select(&VERSIONS[..]),
        degree in 0..=4u8,
        values in prop::collection::vec(value(), 3 * 75),
    ) {
        let file = File::new(version, degree, 3);
        let scene = file.read().unwrap();
        let k = scene.gaussians.sh.per_gaussian();
        let mut sh = scene.gaussians.sh.clone();
        sh.coefficients.copy_from_slice(&values[..3 * k]);
        let bytes = written(&scene, &sh);
        let mut kept = sh.clone();
        for (row, coefficients) in kept.coefficients.chunks_exact_mut(k).enumerate() {
            scene.quantize_colors(row, coefficients);
        }
        // Zeros may have emptied the highest bands.
        let mut expected = kept.clone();
        expected.trim();
        let again = read(&bytes).unwrap().gaussians;
        prop_assert_eq!(again.sh.degree, expected.degree);
        let bits = |sh: &Sh| sh.coefficients.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&again.sh), bits(&expected));
        let geometry = |g: &crate::Gaussians| crate::Gaussians { sh: Sh::default(), ..g.clone() };
        prop_assert_eq!(geometry(&again), geometry(&scene.gaussians));
        // What is kept stays, and is the nearest of what can be kept.
        let once = bits(&kept);
        for (row, coefficients) in kept.coefficients.chunks_exact_mut(k).enumerate() {
            scene.quantize_colors(row, coefficients);
        }
        prop_assert_eq!(bits(&kept), once);
        for (i, (given, kept)) in sh.coefficients.iter().zip(&kept.coefficients).enumerate() {
            let (most, step) = if i % k < 3 { (10.0 / 3.0, 1.0 / 38.25) } else { (127.0 / 128.0, 1.0 / 128.0) };
            let least = if i % k < 3 { -most } else { -1.0 };
            let error = (f64::from(given.clamp(least as f32, most as f32)) - f64::from(*kept)).abs();
            prop_assert!(error <= 0.5 * step + 1e-6, "{given} is kept as {kept}");
        }
        // Written again, it is the same file.
        prop_assert_eq!(written(&scene, &sh), bytes);
    }
}

#[test]
fn every_byte_of_colour_stays_as_it_is() {
    for version in VERSIONS {
        let mut file = File::new(version, 1, 256);
        for i in 0..256 {
            file.sections[COLOURS][3 * i..3 * i + 3].fill(i as u8);
            file.sections[HARMONICS][9 * i..9 * i + 9].fill(i as u8);
        }
        let scene = file.read().unwrap();
        let mut kept = scene.gaussians.sh.clone();
        for (row, coefficients) in kept.coefficients.chunks_exact_mut(12).enumerate() {
            scene.quantize_colors(row, coefficients);
        }
        assert_eq!(kept, scene.gaussians.sh);
        assert_eq!(plain(&written(&scene, &kept)), plain(&file.bytes()));
    }
}

#[test]
fn a_write_changes_the_bytes_of_colours_and_no_others() {
    for version in VERSIONS {
        for degree in [0, 2, 4u8] {
            let mut file = File::new(version, degree, 5);
            // Adobe's camera: a type, a length and three numbers; flags that nobody knows.
            file.extensions = [&0xadbe_0002_u32.to_le_bytes()[..], &12u32.to_le_bytes(), &[7; 12]].concat();
            file.flags = 0xff;
            file.after = b"behind".to_vec();
            let scene = file.read().unwrap();
            assert_eq!(plain(&written(&scene, &scene.gaussians.sh)), plain(&file.bytes()));
            let mut sh = scene.gaussians.sh.clone();
            let k = sh.per_gaussian();
            sh.coefficients[3 * k + 1] = 1.0 / 0.15 * 0.5; // row 3, green: as white as can be
            file.sections[COLOURS][3 * 3 + 1] = 255;
            if degree > 0 {
                let last = k - 4;
                sh.coefficients[2 * k - 1] = -0.25; // row 1, blue, the last of all
                file.sections[HARMONICS][k - 3 + last] = 96;
            }
            let bytes = written(&scene, &sh);
            assert_eq!(
                plain(&bytes),
                plain(&file.bytes()),
                "version {version}, degree {degree}"
            );
            assert_eq!(bytes, written(&scene, &sh));
            assert_eq!(written(&read(&bytes).unwrap(), &sh), bytes);
        }
    }
}

#[test]
fn bands_that_are_not_in_memory_are_written_as_they_were() {
    for version in VERSIONS {
        let mut file = File::new(version, 3, 2);
        for row in file.sections[HARMONICS].chunks_exact_mut(45) {
            row[9..].fill(128);
        }
        let scene = file.read().unwrap();
        assert_eq!(scene.gaussians.sh.degree, 1);
        let mut sh = scene.gaussians.sh.clone();
        sh.coefficients[12 + 11] = 0.5; // row 1, blue, the last of the first band
        file.sections[HARMONICS][45 + 8] = 192;
        assert_eq!(plain(&written(&scene, &sh)), plain(&file.bytes()));
    }
}

#[test]
fn gzip_streams_say_nothing_of_time_and_name() {
    let scene = File::new(3, 0, 1).read().unwrap();
    let bytes = written(&scene, &scene.gaussians.sh);
    assert_eq!(bytes[..9], [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn zero_and_one_gaussian_are_read() {
    for version in VERSIONS {
        for degree in [0, 3] {
            for points in [0, 1] {
                let file = File::new(version, degree, points);
                let scene = file.read().unwrap();
                assert_eq!(scene.gaussians.len(), points as usize);
                assert_eq!(plain(&written(&scene, &scene.gaussians.sh)), plain(&file.bytes()));
            }
        }
    }
}
