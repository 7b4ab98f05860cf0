//! Numbers of half precision: 16 bits, of which 5 are the exponent and 10 the fraction.

/// The largest finite one.
const LARGEST: f32 = 65_504.0;
/// The least normal one.
const LEAST_NORMAL: f32 = 6.103_515_6e-5;
/// What the fraction of one below that counts: 2⁻²⁴.
const STEP: f32 = 5.960_464_5e-8;

/// What 16 bits stand for: every one of them is in single precision too.
pub(super) fn value(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let (exponent, fraction) = (u32::from(bits >> 10) & 31, u32::from(bits) & 0x3ff);
    match exponent {
        0 => f32::from_bits(sign | (fraction as f32 * STEP).to_bits()),
        31 => f32::from_bits(sign | 0x7f80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (exponent + 112) << 23 | fraction << 13),
    }
}

/// The bits of the finite number nearest to a finite one, the even one of two.
pub(super) fn nearest(value: f32) -> u16 {
    let sign = ((value.to_bits() >> 16) & 0x8000) as u16;
    let size = value.abs().min(LARGEST);
    if size < LEAST_NORMAL {
        return sign | (size / STEP).round_ties_even() as u16;
    }
    let bits = size.to_bits() - (112 << 23);
    // Half of the last place less one, and one more where the place is odd: ties go to even ones.
    let rounded = bits + 0xfff + (bits >> 13 & 1);
    sign | (rounded >> 13) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_numbers() {
        for (bits, number) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65_504.0),
            (0x0400, LEAST_NORMAL),
            (0x0001, STEP),
            (0x3555, 0.333_251_95),
        ] {
            assert_eq!((value(bits), nearest(number)), (number, bits));
        }
        assert_eq!(value(0x8000).to_bits(), (-0.0f32).to_bits());
        assert_eq!(value(0xfc00), f32::NEG_INFINITY);
        assert!(value(0x7e00).is_nan());
        assert_eq!((nearest(1e9), nearest(-65_519.9), nearest(1e-9)), (0x7bff, 0xfbff, 0));
        // Half way between 1 and the next, and between that and the one after it.
        assert_eq!((nearest(1.000_488_3), nearest(1.001_464_8)), (0x3c00, 0x3c02));
    }

    #[test]
    fn every_finite_one_stays() {
        for bits in (0..=u16::MAX).filter(|bits| value(*bits).is_finite()) {
            assert_eq!(nearest(value(bits)), bits);
        }
    }

    proptest! {
        #[test]
        fn the_nearest_is_nearest(number in -70_000f32..70_000.0, small in -1e-3f32..1e-3) {
            for number in [number, small] {
                let bits = nearest(number);
                let distance = |bits: u16| (f64::from(value(bits)) - f64::from(number)).abs();
                for other in [bits.wrapping_sub(1), bits.wrapping_add(1)] {
                    prop_assert!(!value(other).is_finite() || distance(bits) <= distance(other));
                }
            }
        }
    }
}
