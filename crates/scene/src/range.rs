//! Numbers stored as whole fractions of a range: colours and opacities as bytes.

/// The constant spherical harmonic: a colour in [0, 1] is `0.5 + C0 * f_dc`.
pub(crate) const C0: f64 = 0.282_094_791_773_878_14;

/// What the smallest and the largest whole number stand for; those between lie on a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    /// What 0 stands for.
    pub min: f32,
    /// What the largest number stands for.
    pub max: f32,
}

impl Range {
    /// Colours from black to white.
    pub const UNIT: Range = Range { min: 0.0, max: 1.0 };

    /// What `value` of 0 to `top` stands for.
    ///
    /// In double precision and by this formula, as the readers of SuperSplat's authors do: the numbers that other
    /// tools find in a file are ours to the last bit.
    pub fn at(self, value: u32, top: u32) -> f64 {
        let share = f64::from(value) / f64::from(top);
        f64::from(self.min) * (1.0 - share) + f64::from(self.max) * share
    }

    /// The constant coefficient of a colour stored as a byte.
    pub fn coefficient(self, byte: u8) -> f32 {
        ((self.at(u32::from(byte), 255) - 0.5) / C0) as f32
    }

    /// The byte whose coefficient is nearest to a finite one.
    pub fn nearest(self, coefficient: f32) -> u8 {
        let (min, max) = (f64::from(self.min), f64::from(self.max));
        let colour = 0.5 + C0 * f64::from(coefficient);
        // A range of no width gives infinities or NaN, which the conversion takes to an end of it.
        let guess = ((colour - min) / (max - min) * 255.0).round() as u8;
        nearest(coefficient, guess, |byte| self.coefficient(byte))
    }
}

/// The byte that `decode` takes nearest to `value`: that of `guess` and its neighbours, the guess where several are.
///
/// Distances are between what is read back, after its rounding to single precision. So a value that was read is
/// nearest to itself, however coarse single precision is at its size.
pub(crate) fn nearest(value: f32, guess: u8, decode: impl Fn(u8) -> f32) -> u8 {
    let distance = |byte| (f64::from(decode(byte)) - f64::from(value)).abs();
    let mut best = guess;
    for other in [guess.saturating_sub(1), guess.saturating_add(1)] {
        if distance(other) < distance(best) {
            best = other;
        }
    }
    best
}

/// The logit of an opacity stored as a byte; infinite at both ends.
pub(crate) fn logit(alpha: u8) -> f32 {
    let opacity = f64::from(alpha) / 255.0;
    -(1.0 / opacity - 1.0).ln() as f32
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Floats of every kind that is finite.
    pub(crate) fn wild() -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<f32>().prop_filter("finite", |v| v.is_finite()),
            -4.5..4.5f32,
            prop::sample::select(vec![0.0, -0.0, 1e30, -1e30, 1e-40, -1e-40, f32::MAX, f32::MIN]),
        ]
    }

    #[test]
    fn bytes_are_fractions_of_the_range() {
        let range = Range { min: -1.0, max: 4.0 };
        assert_eq!(
            (range.at(0, 255), range.at(255, 255), range.at(51, 255)),
            (-1.0, 4.0, 0.0)
        );
        assert_eq!(Range::UNIT.coefficient(0), -1.772_453_9, "-0.5 / C0");
        assert_eq!(Range::UNIT.coefficient(255), 1.772_453_9);
        assert_eq!(Range::UNIT.nearest(0.0), 128, "127.5 rounds up");
        assert_eq!(Range::UNIT.nearest(0.013), 128);
        assert_eq!((Range::UNIT.nearest(-1e30), Range::UNIT.nearest(1e30)), (0, 255));
        let flat = Range { min: 0.25, max: 0.25 };
        assert_eq!(flat.coefficient(flat.nearest(7.0)), ((0.25 - 0.5) / C0) as f32);
    }

    #[test]
    fn opacities_are_bytes() {
        assert_eq!((logit(0), logit(255)), (f32::NEG_INFINITY, f32::INFINITY));
        // 51 is a fifth: ln(1/4).
        assert_eq!((logit(51), logit(204)), (-(4.0f32.ln()), 4.0f32.ln()));
    }

    proptest! {
        #[test]
        fn the_nearest_is_nearest_and_stays(value in wild(), min in wild(), max in wild()) {
            // Colours so large that their coefficients are infinite are refused when they are read.
            let range = Range { min: min * 0.25, max: max * 0.25 };
            let kept = range.coefficient(range.nearest(value));
            prop_assert_eq!(range.coefficient(range.nearest(kept)).to_bits(), kept.to_bits());
            let distance = |v: f32| (f64::from(v) - f64::from(value)).abs();
            for byte in 0..=255 {
                // A bit of slack where single precision is coarser than the steps.
                prop_assert!(distance(kept) <= distance(range.coefficient(byte)) + 1e-6 * distance(kept));
            }
        }
    }
}
