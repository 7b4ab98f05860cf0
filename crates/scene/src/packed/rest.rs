//! Coefficients of the higher bands, stored as a byte each.
//!
//! Writers store the whole part of `32 (v + 4)`; what is read is the middle of that step, but the outermost bytes are
//! -4 and 4. No byte is exactly 0: the writers turn 0 into [`ZERO`], which readers take for half a step more.
use crate::range;

/// What writers store for 0.
const ZERO: u8 = 128;

/// The coefficient that a byte stands for.
pub(crate) fn value(byte: u8) -> f32 {
    match byte {
        0 => -4.0,
        255 => 4.0,
        _ => (f32::from(byte) - 127.5) / 32.0,
    }
}

/// The byte whose coefficient is nearest to a finite one; that of 0 is the writers'.
pub(crate) fn nearest(coefficient: f32) -> u8 {
    // In double precision, in which tiny coefficients do not get lost; out of range the conversion takes the ends.
    let guess = ((f64::from(coefficient) + 4.0) * 32.0).floor() as u8;
    range::nearest(coefficient, guess, value)
}

/// Whether a byte may stand for 0: it is one of the two nearest to it. A band of nothing else says nothing.
pub(super) fn may_be_zero(byte: u8) -> bool {
    byte == ZERO || byte == ZERO - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_the_middles_of_the_steps_of_the_writers() {
        for byte in 1..=254u8 {
            let first = f64::from(byte) / 32.0 - 4.0;
            assert_eq!(f64::from(value(byte)), first + 1.0 / 64.0);
            assert_eq!((nearest(first as f32 + 0.001), nearest(value(byte))), (byte, byte));
        }
        assert_eq!((value(0), value(255)), (-4.0, 4.0));
        assert_eq!((nearest(-4.0), nearest(4.0)), (0, 255));
        assert_eq!((nearest(-1e30), nearest(f32::MAX)), (0, 255));
        // Between the outermost two the middle is elsewhere: -3.976_562_5, and not -3.968_75.
        assert_eq!((nearest(-3.977), nearest(-3.976)), (0, 1));
        assert_eq!((nearest(3.977), nearest(3.976)), (255, 254));
    }

    #[test]
    fn zero_is_what_the_writers_store_for_it() {
        assert_eq!([0.0, -0.0, 1e-40, 0.01].map(nearest), [ZERO; 4]);
        assert_eq!(nearest(-0.01), 127);
        let zeros: Vec<u8> = (0..=255).filter(|byte| may_be_zero(*byte)).collect();
        assert_eq!(zeros, [127, 128]);
        assert!(zeros.iter().all(|byte| value(*byte).abs() == 1.0 / 64.0));
    }
}
