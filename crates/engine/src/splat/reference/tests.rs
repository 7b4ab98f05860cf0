//! The plain renderer against what can be worked out by hand.
use super::super::checks::{camera, scene};
use super::*;

const GREY: [f64; 3] = [0.25, 0.5, 0.75];

/// One Gaussian a row: depth, log scale, logit, DC of red.
fn line(rows: &[(f32, f32, f32, f32)]) -> Gaussians {
    let mut g = scene(rows.len(), 0);
    for (i, (depth, log_scale, logit, red)) in rows.iter().enumerate() {
        g.positions[i] = [0.0, 0.0, *depth];
        g.rotations[i] = [1.0, 0.0, 0.0, 0.0];
        g.log_scales[i] = [*log_scale; 3];
        g.opacity_logits[i] = *logit;
        g.sh.coefficients[3 * i..3 * i + 3].copy_from_slice(&[*red, 0.0, -10.0]);
    }
    g
}

#[test]
fn one_gaussian_at_the_centre() {
    // Odd size: the principal point is the middle of pixel 16, so the centre's exponent is 0.
    let camera = camera(33);
    let g = line(&[(4.0, -2.0, 0.0, 1.0)]);
    let picture = render(&g, &camera, GREY);
    let at = |x: usize, y: usize, j: usize| picture.pixels[3 * (33 * y + x) + j];
    let red = 0.5 + 0.282_094_791_773_878_14;
    // The mean is at (16, 16) up to the 1e-7 that the reference adds to depth: alpha is the opacity, 1/2.
    assert!((at(16, 16, 0) - (0.5 * red + 0.5 * 0.25)).abs() < 1e-6);
    assert!((at(16, 16, 1) - 0.5).abs() < 1e-12, "grey over grey");
    assert!((at(16, 16, 2) - 0.375).abs() < 1e-6, "blue is clamped at 0");
    // One pixel away: variance (f s / z)^2 + 0.3.
    let variance = (f64::from(camera.fx) * (-2f64).exp() / 4.0).powi(2) + 0.3;
    let alpha = 0.5 * (-0.5 / variance).exp();
    assert!((at(17, 16, 0) - (alpha * red + (1.0 - alpha) * 0.25)).abs() < 1e-6);
    assert!((at(16, 15, 0) - at(17, 16, 0)).abs() < 1e-6);
    assert_eq!([at(0, 0, 0), at(0, 0, 1), at(0, 0, 2)], GREY);
}

#[test]
fn two_gaussians_overlap_front_to_back_whatever_their_row() {
    let (near, far) = ((3.0, -2.0, 0.0, 1.0), (5.0, -1.0, 1.0, -1.0));
    let red = |dc: f64| 0.5 + 0.282_094_791_773_878_14 * dc;
    let behind = 1.0 / (1.0 + (-1f64).exp());
    let want = 0.5 * red(1.0) + 0.5 * behind * red(-1.0) + 0.5 * (1.0 - behind) * 0.25;
    for g in [line(&[near, far]), line(&[far, near])] {
        let picture = render(&g, &camera(33), GREY);
        assert!((picture.pixels[3 * (33 * 16 + 16)] - want).abs() < 1e-6);
    }
}

#[test]
fn saturated_gaussians_leave_one_percent_each_and_stop() {
    // Alpha is at most 0.99: after one, 0.01 is left; a second would leave 1e-4 (rounding decides); a third is never
    // drawn because it would leave less than 1e-4.
    let g = line(&[(3.0, -1.0, 20.0, 1.0), (4.0, -1.0, 2.0, 0.0), (5.0, -1.0, 20.0, 2.0)]);
    let alpha = 1.0 / (1.0 + (-2f64).exp());
    let c = 0.282_094_791_773_878_14;
    let want = 0.99 * (0.5 + c) + 0.01 * (alpha * 0.5 + (1.0 - alpha) * 0.25);
    let got = render(&g, &camera(33), GREY).pixels[3 * (33 * 16 + 16)];
    assert!((got - want).abs() < 1e-6, "{got} {want}");
}

#[test]
fn gradient_equals_central_differences() {
    for degree in 0..=4 {
        let mut g = scene(12, degree);
        let camera = camera(24);
        let weight: Vec<f64> = (0..24 * 24 * 3).map(|i| (i as f64 * 0.7).sin()).collect();
        let loss = |g: &Gaussians| {
            render(g, &camera, GREY)
                .pixels
                .iter()
                .zip(&weight)
                .map(|(p, w)| p * w)
                .sum::<f64>()
        };
        let want = gradient(&g, &camera, &weight);
        assert!(
            want.iter().any(|v| v.abs() > 0.1) && want.contains(&0.0),
            "some act and some are clamped or hidden"
        );
        for i in 0..g.sh.coefficients.len() {
            let value = g.sh.coefficients[i];
            // A power of two, so that the step is exact in single precision for coefficients of this size.
            let step = 2f32.powi(-9);
            g.sh.coefficients[i] = value + step;
            let (up, high) = (g.sh.coefficients[i], loss(&g));
            g.sh.coefficients[i] = value - step;
            let (down, low) = (g.sh.coefficients[i], loss(&g));
            g.sh.coefficients[i] = value;
            let difference = (high - low) / (f64::from(up) - f64::from(down));
            assert!(
                (difference - want[i]).abs() < 1e-7,
                "degree {degree}, {i}: {difference} {}",
                want[i]
            );
        }
    }
}

#[test]
fn harmonics_equal_the_published_polynomials() {
    let dir = [0.36, -0.48, 0.8];
    let fast = super::super::sh::basis(4, dir.map(|v| v as f32));
    for (k, want) in harmonics(4, dir).into_iter().enumerate() {
        assert!((f64::from(fast[k]) - want).abs() < 1e-6, "{k}: {} {want}", fast[k]);
    }
}
