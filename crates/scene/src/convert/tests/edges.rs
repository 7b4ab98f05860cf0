//! Scenes at the ends of what formats hold, and beyond them.
use super::*;

fn refused(scene: &Gaussians, format: Format) -> String {
    let mut bytes = Vec::new();
    let error = convert(scene, format, Path::new("it"), &mut bytes).unwrap_err();
    assert!(bytes.is_empty());
    match error {
        Error::BadScene { reason, .. } => reason,
        error => panic!("{error}"),
    }
}

#[test]
fn no_gaussian() {
    for degree in [0, 3] {
        let mut none = Gaussians::default();
        none.sh.degree = degree;
        for format in [Format::Ply, Format::CompressedPly, Format::Spz, Format::Sog] {
            assert!(checked(&none, format).written.order.is_empty());
        }
        assert_eq!(refused(&none, Format::Splat), "no Gaussian; a .splat has one at least");
        assert_eq!(
            refused(&none, Format::Ksplat),
            "no Gaussian; a .ksplat has one at least"
        );
        for format in [Format::Gltf, Format::Glb] {
            assert_eq!(refused(&none, format), "no Gaussian; a glTF has one at least");
        }
    }
}

#[test]
fn flat_axes_and_infinite_opacities() {
    let mut scene = random(300, 1, 1);
    for (row, scales) in scene.log_scales.iter_mut().enumerate() {
        scales[row % 3] = f32::NEG_INFINITY;
        scene.opacity_logits[row] = if row % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
    }
    for format in Format::ALL {
        let file = checked(&scene, format);
        let read = &file.scene.gaussians;
        for (i, row) in file.written.order.iter().enumerate() {
            assert_eq!(read.opacity_logits[i], scene.opacity_logits[*row], "{format:?}");
            let flat = read.log_scales[i][row % 3];
            let least = read
                .log_scales
                .as_flattened()
                .iter()
                .copied()
                .fold(f32::INFINITY, f32::min);
            assert!(flat == least && flat <= -10.0, "{format:?}: {flat}");
        }
    }
    scene.log_scales = vec![[f32::NEG_INFINITY; 3]; 300];
    Format::ALL.into_iter().for_each(|format| _ = checked(&scene, format));
}

#[test]
fn one_place_one_colour() {
    let one = random(1, 3, 2);
    let many = reordered(&one, &[0; 700], 3);
    for format in Format::ALL {
        let file = checked(&many, format);
        let read = &file.scene.gaussians;
        assert!(read.positions.windows(2).all(|pair| pair[0] == pair[1]), "{format:?}");
        assert!(format == Format::Splat || file.written.order.is_sorted(), "{format:?}");
    }
}

/// Of 20,000 alike almost nothing is left compressed, and readers refuse what would unpack to so much more.
#[test]
fn what_would_pass_for_a_bomb_is_refused() {
    let many = reordered(&random(1, 3, 3), &[0; 60_000], 3);
    for format in [Format::Spz, Format::Sog] {
        let reason = refused(&many, format);
        assert!(reason.starts_with("Gaussians so much alike"), "{reason}");
    }
    converted(&many, Format::CompressedPly);
}

#[test]
fn large_numbers() {
    let mut scene = random(300, 1, 4);
    scene.positions[5] = [1e6, -8_388_607.0, 0.0];
    scene.rotations[6] = [1e38, -1e38, 3e38, 0.0];
    scene.rotations[7] = [1e-45, 0.0, 0.0, -1e-45];
    scene.log_scales[8] = [300.0, 60.0, -200.0];
    scene.sh.coefficients[..12].copy_from_slice(&[9.0, -9.0, 1e3, 9.0, -9.0, 1e3, 5.0, -5.0, 2.0, -2.0, 0.0, -0.0]);
    let rows = [Format::Splat, Format::Ksplat];
    for format in Format::ALL.into_iter().filter(|format| !rows.contains(format)) {
        checked(&scene, format);
    }
    // A deviation of e^300 is the largest float.
    for format in rows {
        let read = converted(&scene, format);
        let place = read.written.order.iter().position(|row| *row == 8).unwrap();
        assert_eq!(read.scene.gaussians.log_scales[place][..2], [88.72284, 60.0]);
        assert!(place == 0 || format == Format::Ksplat, "the largest is first");
    }
}

#[test]
fn numbers_without_a_place_are_refused() {
    let scene = random(3, 1, 5);
    let with = |change: &dyn Fn(&mut Gaussians)| {
        let mut changed = scene.clone();
        change(&mut changed);
        changed
    };
    for (change, reason) in [
        (
            &(|g: &mut Gaussians| g.positions[1][2] = f32::NAN) as &dyn Fn(&mut Gaussians),
            "a coordinate of row 1 is NaN",
        ),
        (&|g| g.positions[2][0] = f32::INFINITY, "a coordinate of row 2 is inf"),
        (
            &|g| g.rotations[1][3] = f32::NAN,
            "a component of the rotation of row 1 is NaN",
        ),
        (&|g| g.log_scales[0][1] = f32::INFINITY, "a log scale of row 0 is inf"),
        (&|g| g.opacity_logits[2] = f32::NAN, "the opacity logit of row 2 is NaN"),
        (&|g| g.sh.coefficients[13] = f32::INFINITY, "a colour of row 1 is inf"),
        (
            &|g| g.sh.coefficients.truncate(35),
            "35 coefficients for 3 positions, must be 36",
        ),
        (&|g| g.log_scales.truncate(1), "1 log scales for 3 positions, must be 3"),
        (&|g| g.sh.degree = 5, "spherical harmonics of degree 5; the limit is 4"),
    ] {
        let changed = with(change);
        Format::ALL
            .into_iter()
            .for_each(|format| assert_eq!(refused(&changed, format), reason));
    }
    let far = with(&|g| g.positions[1][0] = -8_388_608.0);
    assert!(refused(&far, Format::Spz).contains("row 1 is -8.388608e6; the limit of SPZ is 8.388607e6"));
    checked(&far, Format::Sog);
    let farther = with(&|g| g.positions[1][0] = 3e38);
    assert!(refused(&farther, Format::Sog).contains("limit of SOG"));
    checked(&farther, Format::CompressedPly);
    let bright = with(&|g| g.sh.coefficients[14] = 3.6e30);
    assert!(refused(&bright, Format::CompressedPly).contains("row 1 is 3.6e30"));
    let less = with(&|g| g.sh.coefficients[14] = 3.5e30);
    checked(&less, Format::CompressedPly);
}
