//! What is kept is what comes back, and a write changes colours only.
use super::*;
use crate::range::tests::wild;
use proptest::prelude::*;

/// Files of one to three chunks with all kinds of bits and ranges.
fn file() -> impl Strategy<Value = File> {
    let end = prop_oneof![-0.2..1.2f64, Just(0.5), -30.0..30.0f64, Just(1e7), Just(-1e30)];
    let chunk = (prop::collection::vec(-9.0..9.0f64, 12), prop::collection::vec(end, 6));
    let rows = prop_oneof![1..6usize, 254..259usize, 511..515usize];
    let parts = (
        rows,
        prop::collection::vec(chunk, 3),
        any::<u64>(),
        0..4usize,
        any::<bool>(),
    );
    parts.prop_map(|(rows, chunks, mut seed, degree, ranges)| {
        let mut file = File::new(rows, 3 * ((degree + 1) * (degree + 1) - 1));
        for (row, (geometry, colour)) in file.chunk().rows.iter_mut().zip(chunks) {
            *row = [geometry, colour].concat();
        }
        let mut random = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            f64::from((seed >> 32) as u32)
        };
        file.vertex()
            .rows
            .iter_mut()
            .flatten()
            .for_each(|value| *value = random());
        if degree > 0 {
            file.sh()
                .rows
                .iter_mut()
                .flatten()
                .for_each(|value| *value = (random() / 16.0) % 256.0);
        }
        if ranges { file } else { file.without_colour_ranges() }
    })
}

/// The file with nothing of its colours.
fn blank(mut file: File, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut at = file.header().len();
    for element in &mut file.elements {
        for _ in &element.rows {
            for (kind, name) in &element.columns {
                let size = if *kind == "uchar" { 1 } else { 4 };
                let colour = match name.as_str() {
                    "packed_color" => at + 1..at + 4,
                    name if COLOUR.contains(&name) || name.starts_with("f_rest_") => at..at + size,
                    _ => at..at,
                };
                bytes[colour].fill(0);
                at += size;
            }
        }
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn what_is_kept_comes_back_and_nothing_else_changes(
        file in file(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), wild()), 1..400),
    ) {
        let bytes = file.bytes();
        let scene = read(&bytes).unwrap();
        let own = &scene.gaussians.sh;
        prop_assert!(written(&scene, own) == bytes);

        let mut sh = own.clone();
        for (place, value) in changes {
            sh.coefficients[place.index(own.coefficients.len())] = value;
        }
        let keeps = kept(&scene, &sh);
        prop_assert_eq!(bits(&kept(&scene, &keeps)), bits(&keeps));
        let out = written(&scene, &sh);
        if sh == *own {
            prop_assert!(out == bytes);
            return Ok(());
        }
        prop_assert!(written(&scene, &sh) == out, "deterministic");
        prop_assert!(blank(file.clone(), &out) == blank(file, &bytes));
        let mut again = read(&out).unwrap();
        if keeps != *own {
            // Where single precision is coarser than the steps, other bytes may be the same colours.
            prop_assert!(read(&written(&scene, &keeps)).unwrap().gaussians == again.gaussians);
        }
        // Bands whose changes left nothing but zeros are not in memory any more.
        if again.gaussians.sh.degree < keeps.degree {
            let left = again.gaussians.sh.per_gaussian();
            let rows = keeps.coefficients.chunks_exact(keeps.per_gaussian());
            prop_assert!(rows.clone().all(|row| row[left..].iter().all(|v| v.abs() == 1.0 / 64.0)));
            let kept: Vec<u32> = rows.flat_map(|row| row[..left].iter().map(|v| v.to_bits())).collect();
            prop_assert_eq!(kept, bits(&again.gaussians.sh));
        } else {
            prop_assert_eq!(bits(&again.gaussians.sh), bits(&keeps));
        }
        again.gaussians.sh = own.clone();
        prop_assert!(again.gaussians == scene.gaussians);
    }

    #[test]
    fn the_colours_of_a_file_stay_where_its_ranges_do(file in file()) {
        let scene = file.clone().without_ranges().read().unwrap();
        prop_assert_eq!(bits(&kept(&scene, &scene.gaussians.sh)), bits(&scene.gaussians.sh));
    }
}

impl File {
    fn without_ranges(self) -> File {
        let has = self.elements[0].columns.len() > GEOMETRY.len();
        if has { self.without_colour_ranges() } else { self }
    }
}

/// A mark of the usual strength on a real file: none of it is cut off, and the second mark needs no new steps in most
/// chunks.
#[test]
fn real_colours_change_freely() {
    let Some(path) = crate::testing::scene_path("biker.compressed.ply") else {
        return;
    };
    let scene = Scene::read(&path).unwrap();
    let own = &scene.gaussians.sh;
    assert!(written(&scene, own) == std::fs::read(&path).unwrap());
    // Triangular between -0.03 and 0.03 and up to 0.1 for a few, as colours.
    let mut seed = 1u64;
    let mut random = || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as f32 / (1 << 24) as f32
    };
    let mut sh = own.clone();
    for value in &mut sh.coefficients {
        let reach = if random() < 0.01 { 0.1 } else { 0.03 };
        *value += (random() - random()) * reach / 0.282_094_8;
    }
    let furthest = |a: &Sh, b: &Sh| {
        let distances = a
            .coefficients
            .iter()
            .zip(&b.coefficients)
            .map(|(a, b)| (a - b).abs() * 0.282_094_8);
        distances.fold(0.0, f32::max)
    };
    let keeps = kept(&scene, &sh);
    assert!(
        furthest(&keeps, &sh) < 0.0024,
        "half a step of 1.2 / 255: {}",
        furthest(&keeps, &sh)
    );
    assert!(furthest(&kept(&scene, own), own) < 0.0024);
    let again = read(&written(&scene, &sh)).unwrap();
    assert!(bits(&again.gaussians.sh) == bits(&keeps));

    let second = kept(&again, &keeps);
    let rows = || {
        second
            .coefficients
            .chunks(3 * 256)
            .zip(keeps.coefficients.chunks(3 * 256))
    };
    let same = rows().filter(|(a, b)| a == b).count();
    assert!(2 * same > rows().count(), "{same} of {} chunks", rows().count());
}
