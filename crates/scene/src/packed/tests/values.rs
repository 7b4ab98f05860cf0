//! Every bit of a file means what the format says, computed here by hand.
use super::*;
use crate::Format;

fn near(found: &[f32], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let slack = 1e-6 * expected.abs().max(1.0);
        assert!((f64::from(*found) - expected).abs() <= slack, "{found} {expected}");
    }
}

/// A Gaussian of the second chunk, in a file whose properties are in another order than usual, among others.
fn unusual() -> File {
    let mut file = File::new(258, 9);
    let ranges = [
        // x, y, z: the numbers themselves, twice them, and one below for one above.
        ("min_x", 0.0),
        ("max_x", 2047.0),
        ("min_y", 0.0),
        ("max_y", 2046.0),
        ("min_z", -1.0),
        ("max_z", 2046.0),
        ("min_scale_x", -2047.0),
        ("max_scale_x", 0.0),
        ("min_scale_y", 0.0),
        ("max_scale_y", 1023.0),
        ("min_scale_z", 5.0),
        ("max_scale_z", 5.0),
        ("min_r", 0.0),
        ("max_r", 1.0),
        ("min_g", -1.0),
        ("max_g", 0.5),
        ("min_b", 0.25),
        ("max_b", 0.75),
    ];
    for (name, value) in ranges {
        file.chunk().set(name, 1, value);
    }
    let words = [
        ("packed_position", 7 << 21 | 8 << 11 | 9u32),
        // The second component is the largest; the others are 0.5, 0.5 and -0.5 as nearly as ten bits hold that.
        ("packed_rotation", 1 << 30 | 873 << 20 | 873 << 10 | 150),
        ("packed_scale", 2047 << 21 | 512 << 11 | 1),
        // Red a fifth, green the end of its range, blue three fifths, opacity four fifths.
        ("packed_color", u32::from_be_bytes([51, 255, 153, 204])),
    ];
    for (name, value) in words {
        file.vertex().set(name, 257, f64::from(value));
    }
    file.vertex().set("packed_color", 0, f64::from(u32::MAX));
    for i in 0..9 {
        file.sh().set(
            &format!("f_rest_{i}"),
            257,
            [0.0, 1.0, 127.0, 128.0, 160.0, 200.0, 100.0, 254.0, 255.0][i],
        );
    }
    file.elements.iter_mut().for_each(Element::reverse);
    file.chunk().insert(4, "double", "more", f64::NAN);
    file.vertex().insert(1, "uchar", "flag", 9.0);
    file.sh().insert(3, "int", "id", -7.0);
    let cameras = Element::new("camera", "uchar", &["a", "b"], vec![vec![1.0, 2.0]; 3]);
    file.elements.reverse();
    file.elements.insert(1, cameras);
    file.after = ("element face 1\nproperty list uchar int i\n".into(), b"anything".into());
    file
}

#[test]
fn all_bits_are_read() {
    let scene = unusual().read().unwrap();
    assert_eq!((scene.format(), scene.exact()), (Format::CompressedPly, false));
    assert_eq!(
        (
            scene.gaussians.len(),
            scene.gaussians.sh.degree,
            scene.learnable_degree()
        ),
        (258, 1, 1)
    );
    let g = &scene.gaussians;
    near(&g.positions[257], &[7.0, 16.0, 8.0]);
    near(&g.log_scales[257], &[0.0, 512.0, 5.0]);
    // (873 / 1023 - 1/2) sqrt(2) and (150 / 1023 - 1/2) sqrt(2).
    let (a, b) = (0.499_744_14, -0.499_744_14);
    near(&g.rotations[257], &[a, (1.0 - 2.0 * a * a - b * b).sqrt(), a, b]);
    near(&g.opacity_logits[257..], &[4.0f64.ln()]);
    let colour = &g.sh.coefficients[257 * 12..];
    let c0 = 0.5 / std::f64::consts::PI.sqrt();
    near(&colour[..3], &[(0.2 - 0.5) / c0, 0.0, (0.55 - 0.5) / c0]);
    // Channel by channel in the file, by coefficient in memory.
    let red = [-4.0, -126.5 / 32.0, -0.5 / 32.0];
    let green = [0.5 / 32.0, 32.5 / 32.0, 72.5 / 32.0];
    let blue = [-27.5 / 32.0, 126.5 / 32.0, 4.0];
    let expected: Vec<f64> = (0..3).flat_map(|k| [red[k], green[k], blue[k]]).collect();
    near(&colour[3..], &expected);
    // The Gaussians before are of the first chunk, all bits 0.
    near(&g.positions[256], &[0.0, 0.0, -1.0]);
    near(&g.positions[255], &[0.0; 3]);
    assert_eq!(g.opacity_logits[255], f32::NEG_INFINITY);
    near(&g.sh.coefficients[255 * 12..255 * 12 + 3], &[-0.5 / c0; 3]);
}

#[test]
fn colours_are_between_black_and_white_in_chunks_without_ranges() {
    let mut file = File::new(1, 0).without_colour_ranges();
    file.vertex()
        .set("packed_color", 0, f64::from(u32::from_be_bytes([0, 51, 255, 0])));
    let scene = file.read().unwrap();
    let c0 = 0.5 / std::f64::consts::PI.sqrt();
    near(&scene.gaussians.sh.coefficients, &[-0.5 / c0, -0.3 / c0, 0.5 / c0]);
}

#[test]
fn a_band_that_cannot_be_told_from_zeros_is_in_the_file_only() {
    for (value, degree) in [(128.0, 1), (127.0, 1), (129.0, 2), (126.0, 2), (0.0, 2)] {
        let mut file = File::new(3, 45);
        file.sh().set("f_rest_17", 1, 200.0); // green's third of the first band
        file.sh().set("f_rest_37", 2, value); // blue's last of the second
        file.vertex().set("packed_color", 2, f64::from(0xffff_ff00u32));
        let scene = file.read().unwrap();
        assert_eq!(
            (scene.gaussians.sh.degree, scene.learnable_degree()),
            (degree, degree),
            "{value}"
        );
        assert_eq!(scene.gaussians.sh.coefficients.len(), 9 * (degree + 1) * (degree + 1));
        let mut sh = scene.gaussians.sh.clone();
        let per_gaussian = sh.per_gaussian();
        assert_eq!(sh.coefficients[per_gaussian + 3 * 3 + 1], 72.5 / 32.0);
        sh.coefficients[per_gaussian + 3 * 3 + 1] = -27.5 / 32.0;
        let bytes = written(&scene, &sh);
        file.sh().set("f_rest_17", 1, 100.0);
        // Colours get ranges with a margin: black is 0.1 / 1.2 of 255, white what is left.
        (0..6).for_each(|k| file.chunk().set(COLOUR[k], 0, [-0.1, 1.1][k / 3]));
        let colours = [[21, 21, 21, 0], [21, 21, 21, 0], [234, 234, 234, 0]];
        (0..3).for_each(|row| {
            file.vertex()
                .set("packed_color", row, f64::from(u32::from_be_bytes(colours[row])))
        });
        assert!(bytes == file.bytes());
    }
}

/// The numbers are splat-transform's (2.7.1).
#[test]
fn a_real_file_is_what_other_tools_find_in_it() {
    let Some(path) = crate::testing::scene_path("biker.compressed.ply") else {
        return;
    };
    let scene = Scene::read(&path).unwrap();
    let g = &scene.gaussians;
    assert_eq!((g.len(), g.sh.degree), (152_746, 0));
    assert_eq!(g.positions[0], [-0.104_536_8, -2.387_898_2, -0.360_811]);
    assert_eq!(
        g.rotations[0],
        [0.461_036_38, -0.062_900_014, 0.884_855_2, 0.022_809_897]
    );
    assert_eq!(g.log_scales[0], [-6.068_917, -4.206_542_5, -7.050_748]);
    assert_eq!(g.opacity_logits[0], -2.577_688_5);
    assert_eq!(g.sh.coefficients[..3], [0.547_868_5, 0.522_284_3, 0.568_151_8]);
    assert_eq!(g.positions[100_000], [0.296_206_68, -2.195_413_8, 0.048_507_96]);
    assert_eq!(
        g.rotations[100_000],
        [0.897_726_66, 0.398_827_58, -0.062_900_014, 0.176_258_3]
    );
    assert_eq!(
        g.sh.coefficients[300_000..300_003],
        [0.495_784_64, 0.435_855, 0.202_987_49]
    );
    assert_eq!(
        g.rotations[152_745],
        [0.998_191_65, 0.040_781_33, -0.042_163_75, 0.013_132_971]
    );
    assert_eq!(g.sh.coefficients[458_235..], [1.119_755_3, 1.097_435, 1.059_750_7]);
}

#[test]
fn what_the_unusual_file_has_besides_stays() {
    let file = unusual();
    let scene = file.read().unwrap();
    assert!(written(&scene, &scene.gaussians.sh) == file.bytes());
    let mut sh = scene.gaussians.sh.clone();
    sh.coefficients[257 * 12 + 4] = 1.0; // green's first of the first band: f_rest_3
    let bytes = written(&scene, &sh);
    // The first chunk is black and white. Of the second red is 0 and a fifth, green -1 and 1/2, blue 1/4 and 0.55.
    let mut expected = file.clone();
    let colour = |red, green, blue, alpha| f64::from(u32::from_be_bytes([red, green, blue, alpha]));
    for (k, ends) in [[-0.1, 0.3], [-1.1, 0.6], [0.15, 0.65]].into_iter().enumerate() {
        expected.chunk().set(COLOUR[k], 0, -0.1);
        expected.chunk().set(COLOUR[k + 3], 0, 1.1);
        expected.chunk().set(COLOUR[k], 1, ends[0]);
        expected.chunk().set(COLOUR[k + 3], 1, ends[1]);
    }
    // 0.1 of 1.2 is 21.25 of 255, of 0.4 63.75, of 1.7 15, of 0.5 51.
    (0..256).for_each(|row| expected.vertex().set("packed_color", row, colour(21, 21, 21, 0)));
    expected.vertex().set("packed_color", 0, colour(234, 234, 234, 255));
    expected.vertex().set("packed_color", 256, colour(64, 15, 51, 0));
    expected.vertex().set("packed_color", 257, colour(191, 240, 204, 204));
    expected.sh().set("f_rest_3", 257, 160.0); // 32 (1 + 4)
    assert!(bytes == expected.bytes());
}
