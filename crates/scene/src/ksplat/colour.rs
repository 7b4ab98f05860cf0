//! Colours of a row: a byte for each of red, green and blue, and harmonics in one of three precisions.
use super::half;
use super::header::{Header, Level, f32_at, u16_at};
use crate::range::{Range, nearest};

/// How harmonics are stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Harmonics {
    level: Level,
    /// What the least and the largest byte stand for.
    range: (f32, f32),
}

impl Harmonics {
    pub fn of(header: &Header) -> Harmonics {
        Harmonics {
            level: header.level,
            range: header.harmonics,
        }
    }

    /// Number `i` of the harmonics of a row, which start with `bytes`.
    pub fn read(self, bytes: &[u8], i: usize) -> f32 {
        match self.level {
            Level::Single => f32_at(bytes, 4 * i),
            Level::Half => half::value(u16_at(bytes, 2 * i)),
            Level::Byte => self.of_byte(bytes[i]),
        }
    }

    /// Writes number `i`. One that is there already keeps its bytes.
    pub fn write(self, bytes: &mut [u8], i: usize, value: f32) {
        if self.read(bytes, i) == value {
            return;
        }
        match self.level {
            Level::Single => bytes[4 * i..4 * i + 4].copy_from_slice(&value.to_le_bytes()),
            Level::Half => bytes[2 * i..2 * i + 2].copy_from_slice(&half::nearest(value).to_le_bytes()),
            Level::Byte => bytes[i] = self.byte(value),
        }
    }

    /// What is read of a number that was written.
    pub fn kept(self, value: f32) -> f32 {
        match self.level {
            Level::Single => value,
            Level::Half => half::value(half::nearest(value)),
            Level::Byte => self.of_byte(self.byte(value)),
        }
    }

    fn of_byte(self, byte: u8) -> f32 {
        let (least, largest) = (f64::from(self.range.0), f64::from(self.range.1));
        (f64::from(byte) / 255.0 * (largest - least) + least) as f32
    }

    fn byte(self, value: f32) -> u8 {
        let (least, largest) = (f64::from(self.range.0), f64::from(self.range.1));
        // A range of no width gives infinities or NaN, which the conversion takes to an end of it.
        let guess = ((f64::from(value) - least) / (largest - least) * 255.0).round() as u8;
        nearest(value, guess, |byte| self.of_byte(byte))
    }
}

/// Which harmonic of a row is at place `i` of the coefficients above the constant ones, red, green and blue of one after
/// the other: files have those of a channel together, band by band.
pub(crate) fn index(i: usize) -> usize {
    let (coefficient, channel) = (i / 3, i % 3);
    match coefficient {
        0..3 => 3 * channel + coefficient,
        _ => 9 + 5 * channel + coefficient - 3,
    }
}

/// Writes red, green and blue where they are not there already.
pub(super) fn write_constants(bytes: &mut [u8], colour: &[f32]) {
    for (byte, value) in bytes.iter_mut().zip(&colour[..3]) {
        *byte = Range::UNIT.nearest(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_are_channel_after_channel_within_a_band() {
        // Of the first coefficient of band 1 red is number 0, green 3, blue 6; the second band follows at 9.
        let first: Vec<usize> = (0..9).map(index).collect();
        assert_eq!(first, [0, 3, 6, 1, 4, 7, 2, 5, 8]);
        assert_eq!([9, 10, 11, 12, 23].map(index), [9, 14, 19, 10, 23]);
    }

    #[test]
    fn bytes_stay_also_where_several_stand_for_the_same() {
        for range in [(-1.5, 1.5), (2.0, 2.0), (3.0, -1.0), (-1e38, 3e38)] {
            let harmonics = Harmonics {
                level: Level::Byte,
                range,
            };
            for byte in 0..=255 {
                let mut bytes = [byte];
                let value = harmonics.read(&bytes, 0);
                harmonics.write(&mut bytes, 0, value);
                assert_eq!((bytes[0], harmonics.kept(value)), (byte, value), "{range:?}");
            }
            let (kept, mut bytes) = (harmonics.kept(0.3), [7]);
            harmonics.write(&mut bytes, 0, 0.3);
            assert_eq!(harmonics.read(&bytes, 0), kept);
        }
    }
}
