//! Powers in plain arithmetic, so that loops of them become vector instructions.

/// `x` to a power from -4 to 4, for normal numbers above 0: in f64 within 1e-9, so that in f32 it is rounded as it should. 0
/// counts as the least normal number.
///
/// `2^(power log2 x)`: the logarithm of the mantissa by the series of the inverse hyperbolic tangent, the power of two by
/// that of the exponential function.
#[inline(always)]
pub(crate) fn power_of(x: f32, power: f64) -> f32 {
    /// Adding and subtracting 1.5 * 2^52 rounds to a whole number, which is then in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // The mantissa from the root of 1/2 to that of 2, and the exponent that goes with it.
    let bits = x.to_bits();
    let above = bits.wrapping_sub(0x3f35_04f3);
    let exponent = f64::from((above as i32) >> 23);
    let mantissa = f64::from(f32::from_bits((above & 0x007f_ffff) + 0x3f35_04f3));
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let z = s * s;
    let mut series = 1.0 / 13.0;
    for k in [11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        series = series * z + 1.0 / k;
    }
    let log2 = exponent + s * series * (2.0 * std::f64::consts::LOG2_E);
    let y = power * log2;
    let shifted = y + ROUND;
    let r = (y - (shifted - ROUND)) * std::f64::consts::LN_2;
    let mut series = 1.0 / 40_320.0;
    for factorial in [5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0] {
        series = series * r + 1.0 / factorial;
    }
    let scale = f64::from_bits((shifted.to_bits().wrapping_add(1023)) << 52);
    (series * scale) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_rounded_right() {
        for i in 0..60_000 {
            let x = 0.125 * 1.000_25_f32.powi(i);
            for power in [-0.2_f32, -1.0, -0.013, 0.0, 0.7, 2.5] {
                let (found, exact) = (power_of(x, f64::from(power)), f64::from(x).powf(f64::from(power)));
                let off = (f64::from(found) / exact - 1.0).abs();
                assert!(off < 6.1e-8, "{x} to the power of {power}: {found}, not {exact}");
            }
        }
    }

    #[test]
    fn powers_of_nothing_are_nearly_nothing() {
        for power in [0.3, 1.0, 3.0] {
            let found = power_of(0.0, power);
            assert!((0.0..1e-11).contains(&found), "{power}: {found}");
        }
    }
}
