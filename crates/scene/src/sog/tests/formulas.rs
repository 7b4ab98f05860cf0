//! Values against the published formulas, worked out by hand.
use super::*;
use crate::container::Format;

fn close(found: f32, expected: f64) {
    assert!(
        (f64::from(found) - expected).abs() <= 1e-6 * expected.abs().max(1.0),
        "{found} is not {expected}"
    );
}

/// Five Gaussians with pixels that are easy to work out.
fn by_hand(version: u64) -> File {
    let mut file = File::new(version, 1, 5)
        .with("/means/mins", json!([-2.0, 0.0, 1.0]))
        .with("/means/maxs", json!([2.0, 1.0, 1.0]))
        .pixel("means_l", 0, [0, 0, 7, 9])
        .pixel("means_u", 0, [0, 0, 9, 9])
        .pixel("means_l", 1, [255, 0x33, 255, 9])
        .pixel("means_u", 1, [255, 0x33, 255, 9])
        .pixel("quats", 0, [255, 0, 51, 252])
        .pixel("quats", 1, [102, 102, 153, 253])
        .pixel("quats", 2, [102, 102, 153, 254])
        .pixel("quats", 3, [102, 102, 153, 255])
        .pixel("quats", 4, [0, 0, 0, 252])
        .pixel("scales", 3, [0, 51, 255, 3])
        .pixel("sh0", 3, [255, 0, 51, 51])
        .pixel("sh0", 1, [0, 0, 0, 0])
        .pixel("sh0", 2, [0, 0, 0, 255])
        .pixel("shN_labels", 3, [65, 0, 9, 9]);
    // Row 65 of the palette is the second of the second row of pixels, which has 64 x 3.
    let centroids = file.pixels("shN_centroids");
    centroids[192 + 3] = [51, 0, 255, 1];
    centroids[192 + 4] = [102, 1, 2, 1];
    centroids[192 + 5] = [3, 4, 0, 1];
    file
}

#[test]
fn geometry_is_what_the_formulas_say() {
    for version in [1, 2] {
        let gaussians = by_hand(version).read().unwrap().gaussians;
        assert_eq!(gaussians.len(), 5, "pixels beyond the count are none");
        // sign(n) (exp(|n|) - 1) of the ends of the ranges, and of a fifth (0x3333 of 0xffff).
        let p = &gaussians.positions;
        close(p[0][0], 1.0 - 2f64.exp());
        close(p[1][0], 2f64.exp() - 1.0);
        close(p[0][1], 0.0);
        close(p[1][1], 0.2f64.exp() - 1.0);
        close(p[0][2], 1f64.exp() - 1.0);
        close(p[1][2], 1f64.exp() - 1.0);
        // (2 byte / 255 - 1) / sqrt(2); w, x, y, z with the largest left out: 255 -> 0.7071, 51 -> -0.4243.
        let q = &gaussians.rotations;
        let half = 0.5f64.sqrt();
        let expected = [0.0, half, -half, -0.6 * half];
        (0..4).for_each(|i| close(q[0][i], expected[i]));
        let (a, rest) = (0.2 * half, (1f64 - 3.0 * 0.02).sqrt());
        for (row, expected) in [[-a, rest, -a, a], [-a, -a, rest, a], [-a, -a, a, rest]]
            .into_iter()
            .enumerate()
        {
            (0..4).for_each(|i| close(q[row + 1][i], expected[i]));
        }
        assert_eq!(
            q[4][0], 0.0,
            "what the others leave, never the root of less than nothing"
        );
    }
}

#[test]
fn version_2_looks_numbers_up() {
    let scene = by_hand(2).read().unwrap();
    let g = &scene.gaussians;
    // The tables of the test's files: 0.01 i (salt + 3) - 2.5.
    close(g.log_scales[3][0], -2.5);
    close(g.log_scales[3][1], 0.03 * 51.0 - 2.5);
    close(g.log_scales[3][2], 0.03 * 255.0 - 2.5);
    assert_eq!(g.sh.degree, 1);
    let colour = &g.sh.coefficients[3 * 12..4 * 12];
    close(colour[0], 0.04 * 255.0 - 2.5);
    close(colour[1], -2.5);
    close(colour[2], 0.04 * 51.0 - 2.5);
    let rest = [51, 0, 255, 102, 1, 2, 3, 4, 0].map(|index: u8| 0.05 * f64::from(index) - 2.5);
    (0..9).for_each(|i| close(colour[3 + i], rest[i]));
    // Opacity is alpha / 255: ln(0.2 / 0.8) for 51, none and all for the ends.
    close(g.opacity_logits[3], 0.25f64.ln());
    assert_eq!(g.opacity_logits[1], f32::NEG_INFINITY);
    assert_eq!(g.opacity_logits[2], f32::INFINITY);
    assert_eq!(
        (scene.format(), scene.exact(), scene.learnable_degree()),
        (Format::Sog, false, 0)
    );
}

#[test]
fn version_1_is_steps_between_two_numbers() {
    for version in [Value::Null, 1.into()] {
        let g = by_hand(1).with("/version", version).read().unwrap().gaussians;
        close(g.log_scales[3][0], -9.0);
        close(g.log_scales[3][1], -8.0 + 6.0 * 0.2);
        close(g.log_scales[3][2], -3.0);
        assert_eq!(g.sh.degree, 1);
        let colour = &g.sh.coefficients[3 * 12..4 * 12];
        close(colour[0], 2.0);
        close(colour[1], -1.5);
        close(colour[2], -1.0 + 4.0 * 0.2);
        let rest = [51, 0, 255, 102, 1, 2, 3, 4, 0].map(|byte: u8| -1.0 + 2.5 * f64::from(byte) / 255.0);
        (0..9).for_each(|i| close(colour[3 + i], rest[i]));
        // Opacity is a logit.
        close(g.opacity_logits[3], -5.0 + 10.0 * 0.2);
        close(g.opacity_logits[1], -5.0);
        close(g.opacity_logits[2], 5.0);
    }
}

#[test]
fn labels_have_two_bytes() {
    let mut file = File::new(2, 1, 3).with("/shN/count", 300.into());
    let last = &mut file.pictures[5];
    assert_eq!(last.0, "shN_centroids");
    last.2 = noise(5 * 192, 6);
    last.2[258 * 3] = [10, 20, 30, 40];
    let g = file.pixel("shN_labels", 2, [2, 1, 77, 0]).read().unwrap().gaussians;
    let colour = &g.sh.coefficients[24 + 3..];
    for (value, index) in colour.iter().zip([10.0, 20.0, 30.0]) {
        close(*value, 0.05 * index - 2.5);
    }
}

#[test]
fn bands_that_nobody_uses_are_in_the_file_only() {
    for bands in 1..=3 {
        let coefficients = (bands + 1) * (bands + 1) - 1;
        for used in 0..=bands {
            let mut file = File::new(2, bands, 6).with("/shN/codebook/9", 0.0.into());
            for (i, texel) in file.pixels("shN_centroids").iter_mut().enumerate() {
                let place = i % coefficients;
                // A row that has no Gaussian may have anything.
                if i / coefficients != PALETTE - 1 && (place + 1).isqrt() > used {
                    *texel = [9, 9, 9, 9];
                }
            }
            file.pixels("shN_labels").iter_mut().for_each(|label| label[0] %= 60);
            let scene = file.read().unwrap();
            let sh = &scene.gaussians.sh;
            assert_eq!(sh.degree, used, "{bands} bands");
            assert_eq!(sh.coefficients.len(), 6 * sh.per_gaussian());
            let all = File::new(2, bands, 6);
            let (whole, per) = (3 * (coefficients + 1), sh.per_gaussian());
            let mut all = all.with("/shN/codebook/9", 0.0.into());
            all.pixels("shN_labels").iter_mut().for_each(|label| label[0] %= 60);
            let all = all.read().unwrap().gaussians.sh.coefficients;
            for row in 0..6 {
                assert_eq!(sh.coefficients[row * per..][..per], all[row * whole..][..per]);
            }
        }
    }
}

#[test]
fn one_coefficient_is_a_band() {
    for (place, degree) in [(0, 1), (2, 1), (3, 2), (7, 2), (8, 3), (14, 3)] {
        let mut file = File::new(2, 3, 6)
            .with("/shN/codebook/9", 0.0.into())
            .pixel("shN_labels", 4, [7, 0, 0, 0]);
        file.pixels("shN_centroids").fill([9; 4]);
        let file = file.pixel("shN_centroids", 7 * 15 + place, [9, 9, 8, 9]);
        let sh = file.read().unwrap().gaussians.sh;
        assert_eq!(sh.degree, degree, "place {place}");
        close(
            sh.coefficients[4 * sh.per_gaussian() + 3 * (place + 1) + 2],
            0.05 * 8.0 - 2.5,
        );
    }
}

#[test]
fn no_gaussians_are_read() {
    for version in [1, 2] {
        let scene = File::new(version, 2, 0).read().unwrap();
        assert!(scene.gaussians.is_empty());
        assert_eq!(scene.gaussians.sh.degree, 0);
        assert_eq!(written(&scene, &scene.gaussians.sh), File::new(version, 2, 0).bytes());
    }
    assert_eq!(File::new(2, 0, 1).read().unwrap().gaussians.len(), 1);
}
