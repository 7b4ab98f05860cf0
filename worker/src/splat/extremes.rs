//! Scenes at the limits of what is legal, and the outcome that each must have.
use super::checks::{BACKGROUND, camera, scene};
use super::{Learnable, PreparedView, Rasterizer, WeightCache, prepare, sh};
use crate::scene::Gaussians;

/// Needles, discs, pixel-small ones, saturated and faint ones, zero quaternions, colours far out of range, some
/// beside the picture.
pub(super) fn shapes() -> Gaussians {
    let mut g = scene(240, 2);
    for i in 0..g.len() {
        let z = g.positions[i][2];
        match i % 6 {
            0 => g.log_scales[i] = [0.5, -9.0, -9.0],
            1 => g.log_scales[i] = [-1.0, -1.0, -30.0],
            2 => g.log_scales[i] = [-12.0; 3],
            3 => g.opacity_logits[i] = if i % 12 == 3 { f32::INFINITY } else { -5.3 },
            4 => g.rotations[i] = [0.0; 4],
            _ => g.sh.coefficients[i * 27] = if i % 12 == 5 { 3.0 } else { -8.0 },
        }
        if i % 7 == 0 {
            // Beyond the edge of the picture and reaching in: where the Jacobian's clamp acts.
            g.positions[i][i % 2] = 0.9 * z;
            g.log_scales[i] = [0.2, -0.5, -1.0];
            g.opacity_logits[i] = -1.0;
        }
    }
    g
}

/// Input that is legal and strange: the outcome is a picture of finite numbers, and what must be background is.
pub(super) fn all(rasterizer: &dyn Rasterizer, cache: WeightCache) {
    let camera = camera(40);
    let draw = |g: &Gaussians| -> (PreparedView, Vec<f32>, Vec<f32>) {
        let view = prepare(g, &camera, cache).unwrap();
        let colours = sh::colours(&g.sh, None, &view);
        let pixels = rasterizer.render(&view, &colours, BACKGROUND).unwrap().pixels;
        let colour_gradient = rasterizer.backward(&view, &vec![1.0; pixels.len()]).unwrap();
        let mut gradient = vec![0.0; g.sh.coefficients.len()];
        sh::backward(&Learnable::all(g), &view, &colours, &colour_gradient, &mut gradient);
        assert!(pixels.iter().chain(&gradient).all(|v| v.is_finite()));
        (view, pixels, gradient)
    };
    let empty = |g: &Gaussians, what: &str| {
        let (view, pixels, gradient) = draw(g);
        assert!(view.visible.is_empty(), "{what}");
        assert!(pixels.chunks(3).all(|p| p == BACKGROUND), "{what}");
        assert!(gradient.iter().all(|v| *v == 0.0), "{what}");
    };
    let with = |change: &dyn Fn(&mut Gaussians)| {
        let mut g = scene(1, 1);
        g.positions[0] = [0.0, 0.0, 3.0];
        g.log_scales[0] = [-1.0; 3];
        g.opacity_logits[0] = 2.0;
        change(&mut g);
        g
    };
    empty(&scene(0, 3), "no Gaussian");
    empty(&with(&|g| g.positions[0] = [0.0, 0.0, -3.0]), "behind the camera");
    empty(&with(&|g| g.positions[0] = [0.0; 3]), "at the camera");
    empty(&with(&|g| g.positions[0] = [0.0, 0.0, 0.2]), "on the near plane");
    empty(&with(&|g| g.positions[0] = [90.0, 0.0, 3.0]), "out of view");
    empty(&with(&|g| g.positions[0] = [3e38, -3e38, 3e38]), "far away");
    empty(&with(&|g| g.opacity_logits[0] = f32::NEG_INFINITY), "transparent");
    empty(&with(&|g| g.opacity_logits[0] = f32::NAN), "opacity not a number");
    empty(&with(&|g| g.positions[0][1] = f32::NAN), "position not a number");
    empty(&with(&|g| g.log_scales[0][1] = f32::NAN), "scale not a number");

    let seen = |g: &Gaussians, what: &str| {
        let (view, pixels, gradient) = draw(g);
        assert_eq!(view.visible.len(), 1, "{what}");
        assert!(pixels.chunks(3).any(|p| p != BACKGROUND), "{what}");
        assert!(gradient.iter().any(|v| *v != 0.0), "{what}");
        (pixels, gradient)
    };
    seen(&with(&|_| ()), "ordinary");
    seen(&with(&|g| g.rotations[0] = [0.0; 4]), "zero quaternion");
    seen(
        &with(&|g| g.rotations[0] = [f32::INFINITY, 0.0, 0.0, 1.0]),
        "infinite quaternion",
    );
    seen(&with(&|g| g.log_scales[0] = [f32::NEG_INFINITY; 3]), "a point");
    seen(
        &with(&|g| g.log_scales[0] = [20.0, -20.0, 3.0]),
        "a needle across the universe",
    );
    for size in [20.0, 1e30, f32::INFINITY] {
        let (pixels, _) = seen(&with(&|g| g.log_scales[0] = [size; 3]), "larger than the picture");
        assert!(
            pixels.chunks(3).all(|p| (p[0] - pixels[0]).abs() < 1e-5),
            "covers all of it alike"
        );
    }
    let opaque = with(&|g| {
        g.opacity_logits[0] = f32::INFINITY;
        g.log_scales[0] = [3.0; 3];
        g.sh.coefficients.fill(0.0);
    });
    let (pixels, _) = seen(&opaque, "opaque");
    assert!(
        (pixels[0] - (0.99 * 0.5 + 0.01 * BACKGROUND[0])).abs() < 1e-5,
        "alpha is at most 0.99"
    );
    let (pixels, gradient) = seen(
        &with(&|g| {
            g.sh.coefficients.fill(0.0);
            g.sh.coefficients[..3].copy_from_slice(&[1e6, -1e6, 0.0]);
        }),
        "colours of a million",
    );
    let middle = 3 * (40 * 20 + 20);
    assert!(pixels[middle] > 1e5 && pixels[middle + 1] < 0.6 && pixels[middle + 1] >= 0.0);
    assert!(
        gradient[0] > 0.0 && gradient[1] == 0.0 && gradient[2] > 0.0,
        "a clamped colour has no gradient"
    );
}
