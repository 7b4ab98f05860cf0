//! What several formats do to a number before they store it.
use crate::range::Range;

/// Opacity in [0, 1] of a logit that may be infinite.
pub(super) fn opacity(logit: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(logit)).exp())
}

/// Opacity as the nearest of 255 steps.
pub(super) fn opacity_byte(logit: f32) -> u8 {
    byte(255.0 * opacity(logit))
}

/// The nearest byte; conversion to an integer stays within 0 to 255.
pub(super) fn byte(value: f64) -> u8 {
    value.round() as u8
}

/// The nearest of the steps 0 to `top` between the ends of `range`; values beyond them get an end.
pub(super) fn step(range: Range, value: f32, top: u32) -> u32 {
    let (min, max) = (f64::from(range.min), f64::from(range.max));
    // A range of no width gives infinities or NaN, which the conversion takes to an end of it.
    let share = (f64::from(value) - min) / (max - min);
    ((share * f64::from(top)).round() as u32).min(top)
}

/// The quaternion of length 1 of the same rotation; that of none where the length is 0.
pub(crate) fn unit(rotation: [f32; 4]) -> [f64; 4] {
    // The largest component is divided out first: squares of the largest floats fit in double precision anyway, but
    // those of the smallest would lose their digits.
    let largest = rotation.iter().fold(0.0f64, |most, v| most.max(f64::from(v.abs())));
    if largest == 0.0 {
        return [1.0, 0.0, 0.0, 0.0];
    }
    let scaled = rotation.map(|v| f64::from(v) / largest);
    let length = scaled.iter().map(|v| v * v).sum::<f64>().sqrt();
    scaled.map(|v| v / length)
}

/// The place of the component of largest magnitude, the first of several, and the other three in their order, all with
/// the sign with which the largest is not negative.
pub(super) fn smallest_three(unit: [f64; 4]) -> (usize, [f64; 3]) {
    let mut largest = 0;
    for i in 1..4 {
        if unit[i].abs() > unit[largest].abs() {
            largest = i;
        }
    }
    let sign = if unit[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut others = (0..4).filter(|i| *i != largest).map(|i| sign * unit[i]);
    (largest, std::array::from_fn(|_| others.next().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinite_logits_are_the_ends() {
        let bytes = [f32::NEG_INFINITY, -200.0, 0.0, 1.386_294_4, 200.0, f32::INFINITY].map(opacity_byte);
        assert_eq!(bytes, [0, 0, 128, 204, 255, 255]);
    }

    #[test]
    fn steps_are_the_nearest() {
        let range = Range { min: -1.0, max: 3.0 };
        let steps = [-9.0, -1.0, -0.51, -0.49, 2.9, 3.0, 4.0].map(|v| step(range, v, 4));
        assert_eq!(steps, [0, 0, 0, 1, 4, 4, 4]);
        let flat = Range { min: 2.0, max: 2.0 };
        assert!(step(flat, 2.0, 7) <= 7 && step(flat, 3.0, 7) <= 7);
        assert_eq!(step(range, f32::NEG_INFINITY, 4), 0);
    }

    #[test]
    fn rotations_of_any_length() {
        assert_eq!(unit([0.0; 4]), [1.0, 0.0, 0.0, 0.0]);
        for length in [1e-45f32, 1e-20, 1.0, 1e38] {
            let [w, x, ..] = unit([0.0, -length, 0.0, 0.0]);
            assert_eq!((w, x), (0.0, -1.0), "{length}");
        }
        let (largest, others) = smallest_three(unit([1.0, -5.0, 2.0, -3.0]));
        let length = 39f64.sqrt();
        assert_eq!(largest, 1);
        for (found, expected) in others.into_iter().zip([-1.0, -2.0, 3.0]) {
            assert!((found - expected / length).abs() < 1e-15);
        }
    }
}
