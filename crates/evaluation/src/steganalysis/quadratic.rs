//! The equations of second degree that the structural detectors end in.
use super::detector::NoResult;

/// The root of `a x² + b x + c = 0` that has the smaller absolute value, as all the papers choose.
///
/// Where noise makes the roots complex, their common real part `-b / 2a` is taken: at full embedding the two roots
/// coincide, so that half of the fully embedded pictures would be without a result else. No equation, no result.
pub(super) fn smaller_root(a: f64, b: f64, c: f64) -> Result<f64, NoResult> {
    let discriminant = b * b - 4.0 * a * c;
    let root = if c == 0.0 && (a != 0.0 || b != 0.0) {
        0.0
    } else if discriminant < 0.0 {
        -b / (2.0 * a)
    } else {
        // The form without cancellation, which is the root of the line where a is 0.
        -2.0 * c / (b + discriminant.sqrt().copysign(b))
    };
    if root.is_finite() {
        Ok(root)
    } else {
        Err(NoResult::NoRoot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        for (a, b, c, expected) in [
            (1.0, -3.0, 2.0, 1.0),
            (1.0, 3.0, 2.0, -1.0),
            (-1.0, 3.0, -2.0, 1.0),
            (2.0, -1.0, 0.0, 0.0),
            (0.0, 4.0, -2.0, 0.5),
            (0.0, -4.0, 2.0, 0.5),
            (1.0, 0.0, 0.0, 0.0),
            (1.0, -2.0, 1.0, 1.0),
            (1.0, -2.0, 1.5, 1.0), // complex
        ] {
            let root = smaller_root(a, b, c).unwrap();
            assert!((root - expected).abs() < 1e-12, "{a} {b} {c}: {root}");
        }
    }

    #[test]
    fn no_equation_no_result() {
        for (a, b, c) in [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (f64::NAN, 1.0, 1.0)] {
            assert_eq!(smaller_root(a, b, c), Err(NoResult::NoRoot));
        }
    }
}
