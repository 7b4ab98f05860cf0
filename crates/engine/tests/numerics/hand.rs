//! The reference renderer against cases computed by hand: pixels of a camera whose numbers are round.
use guardsplat_engine::scene::Gaussians;
use guardsplat_engine::splat::reference;
use guardsplat_engine::view::Camera;

use super::scenes::none;

const GREY: [f64; 3] = [0.25, 0.5, 0.75];
/// The constant harmonic, 1 / (2 sqrt(pi)).
const C0: f64 = 0.282_094_791_773_878_14;
/// The factor of those of degree 1, sqrt(3 / (4 pi)).
const C1: f64 = 0.488_602_511_902_919_9;

/// 33 x 33 pixels with a focal length of 33: an object at depth 3.3 is drawn ten times as large, in pixels, as it is in
/// units, and what lies on the axis is at the middle of pixel (16, 16).
fn camera() -> Camera {
    Camera {
        width: 33,
        height: 33,
        fx: 33.0,
        fy: 33.0,
        cx: 16.5,
        cy: 16.5,
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [0.0; 3],
    }
}

/// A ball on the axis; red is `0.5 + C0 red`, green a half, blue far below 0.
fn add(g: &mut Gaussians, depth: f32, deviation: f32, logit: f32, red: f32) {
    g.positions.push([0.0, 0.0, depth]);
    g.rotations.push([1.0, 0.0, 0.0, 0.0]);
    g.log_scales.push([deviation.ln(); 3]);
    g.opacity_logits.push(logit);
    g.sh.coefficients.extend([red, 0.0, -10.0]);
}

fn scene(balls: &[(f32, f32, f32, f32)]) -> Gaussians {
    let mut g = none(0);
    for (depth, deviation, logit, red) in balls {
        add(&mut g, *depth, *deviation, *logit, *red);
    }
    g
}

/// The pixel `x`, `y` pixels from the middle.
fn pixel(g: &Gaussians, x: usize, y: usize) -> [f64; 3] {
    let picture = reference::render(g, &camera(), GREY);
    let at = 3 * (33 * (16 + y) + 16 + x);
    std::array::from_fn(|k| picture.pixels[at + k])
}

fn near(got: f64, want: f64) {
    assert!((got - want).abs() < 1e-6, "{got} instead of {want}");
}

/// Centred on a pixel there is no exponent: alpha is the opacity, a half.
pub fn centre_and_background() {
    let [red, green, blue] = pixel(&scene(&[(3.3, 0.2, 0.0, 1.0)]), 0, 0);
    near(red, 0.5 * (0.5 + C0) + 0.5 * 0.25);
    near(red, 0.516_047_396);
    near(green, 0.5);
    near(blue, 0.5 * 0.0 + 0.5 * 0.75);
    assert_eq!(pixel(&scene(&[]), 3, 5), GREY);
}

/// A deviation of 0.2 at depth 3.3 is two pixels, and the filter adds 0.3 to the variance: three pixels off, alpha is
/// `exp(-9 / (2 * 4.3)) / 2` = 0.1755803. A point has the filter's 0.3 alone: one pixel off `exp(-1 / 0.6) / 2` =
/// 0.0944378, and two pixels off 0.0006, which is below 1/255 and not drawn.
pub fn low_pass_and_cutoff() {
    let ball = scene(&[(3.3, 0.2, 0.0, 1.0)]);
    near(pixel(&ball, 3, 0)[0], 0.175_580_297 * (0.5 + C0) + 0.824_419_703 * 0.25);
    near(pixel(&ball, 0, 3)[0], pixel(&ball, 3, 0)[0]);
    let point = scene(&[(3.3, 0.0, 0.0, 1.0)]);
    assert_eq!(point.log_scales[0], [f32::NEG_INFINITY; 3]);
    near(pixel(&point, 1, 0)[0], 0.300_249_862);
    assert_eq!(pixel(&point, 2, 0), GREY);
}

/// An opacity of 1 is drawn as 0.99.
pub fn alpha_is_at_most_099() {
    near(
        pixel(&scene(&[(3.3, 1.0, 20.0, 1.0)]), 0, 0)[0],
        0.99 * (0.5 + C0) + 0.01 * 0.25,
    );
}

/// Alphas 1/2 in front and 3/4 behind, whichever is first in the file: `c1 / 2 + 3/4 c2 / 2 + background / 8`.
pub fn order() {
    let (half, three_quarters) = (0.0, 3f32.ln());
    let (bright, dark) = (0.5 + C0, 0.5 - C0);
    for swap in [false, true] {
        let mut balls = [(2.0, 0.5, half, 1.0), (3.0, 0.5, three_quarters, -1.0)];
        if swap {
            balls.reverse();
        }
        near(
            pixel(&scene(&balls), 0, 0)[0],
            0.5 * bright + 0.375 * dark + 0.125 * 0.25,
        );
    }
    let other_depths = [(3.0, 0.5, half, 1.0), (2.0, 0.5, three_quarters, -1.0)];
    near(
        pixel(&scene(&other_depths), 0, 0)[0],
        0.75 * dark + 0.125 * bright + 0.125 * 0.25,
    );
}

/// Degree 1 is `-C1 y, C1 z, -C1 x` of the direction in which the Gaussian is seen: the one of z adds from one side
/// and takes away from the other, the one of x takes away where it is seen along +x, and adds nothing along z.
pub fn direction() {
    let seen_along = |direction: [f32; 3], coefficient: usize| {
        let mut g = none(1);
        g.positions.push(direction.map(|v| 3.3 * v));
        g.rotations.push([1.0, 0.0, 0.0, 0.0]);
        g.log_scales.push([-2.0; 3]);
        g.opacity_logits.push(0.0);
        g.sh.coefficients = vec![0.0; 12];
        g.sh.coefficients[3 * coefficient] = 1.0;
        let up = [0.0, -1.0, 0.0];
        let turned = Camera::look_at([0.0; 3], direction, up, 1.0, 33, 33);
        let picture = reference::render(&g, &turned, [0.0; 3]);
        // Over black, and half as bright: alpha is a half.
        2.0 * picture.pixels[3 * (33 * 16 + 16)]
    };
    near(seen_along([0.0, 0.0, 1.0], 2), 0.5 + C1);
    near(seen_along([0.0, 0.0, -1.0], 2), 0.5 - C1);
    near(seen_along([1.0, 0.0, 0.0], 3), 0.5 - C1);
    near(seen_along([-1.0, 0.0, 0.0], 3), 0.5 + C1);
    near(seen_along([0.0, 0.0, 1.0], 3), 0.5);
    near(seen_along([0.0, 0.0, 1.0], 1), 0.5);
}
