//! Curves of tones that people bend by an S: more contrast in the middle, black and white stay.
//!
//! `y = x - bend sin(2 pi x) / (2 pi)`, which is within 0.005 of a sigmoid of a slope of up to 7. With `w = 2 x - 1` the sine is
//! the polynomial `-w (1 - w^2) (a + b w^2 + c w^4)`, within 4e-4, so that registers of pixels are undone together.

/// The polynomial's coefficients a, b and c, by least squares over [0, 1].
const SINE: [f32; 3] = [3.1395, -1.9985, 0.4388];
/// Least and largest bend: beyond, a curve would not rise everywhere.
const BENDS: [f32; 2] = [-0.8, 0.9];
/// Steps of Newton's iteration from the value itself.
const STEPS: usize = 4;

/// The bend, or the nearest that a curve may have.
pub(super) fn limited(bend: f32) -> f32 {
    bend.clamp(BENDS[0], BENDS[1])
}

/// The value before the curve; what lies beyond black or white stays as far beyond.
#[inline(always)]
pub(super) fn before(value: f32, bend: f32) -> f32 {
    use std::f32::consts::FRAC_1_PI;
    let [a, b, c] = SINE;
    let inside = value.clamp(0.0, 1.0);
    let mut x = inside;
    for _ in 0..STEPS {
        let w = 2.0 * x - 1.0;
        let square = w * w;
        let sine = w * (1.0 - square) * (a + square * (b + square * c));
        let slope = a + square * (3.0 * (b - a) + square * (5.0 * (c - b) - 7.0 * square * c));
        let too_much = x + 0.5 * FRAC_1_PI * bend * sine - inside;
        x = (x - too_much / (1.0 + FRAC_1_PI * bend * slope)).clamp(0.0, 1.0);
    }
    x + (value - inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_undone() {
        for bend in [-0.8, -0.3, 0.0, 0.4, 0.8, 0.9] {
            for i in -10..=110_i16 {
                let x = f32::from(i) / 100.0;
                let inside = f64::from(x.clamp(0.0, 1.0));
                let sine = (2.0 * std::f64::consts::PI * inside).sin();
                let bent = x - (f64::from(bend) * sine / (2.0 * std::f64::consts::PI)) as f32;
                let error = (before(bent, bend) - x).abs();
                assert!(error < 0.003, "{bend} {x}: {error}");
            }
        }
        assert_eq!([-9.0, 9.0].map(limited), [-0.8, 0.9]);
    }
}
