//! A message: up to 150 bits, most significant first, told in hexadecimal.
use std::fmt;

use rand::Rng;

use crate::error::{Error, Result};

/// Most bits a message can have: two at each of [`POSITIONS`](super::tokens::POSITIONS).
pub const MAX_BITS: usize = 150;

/// Bits, most significant first; never empty and never longer than [`MAX_BITS`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Message {
    bits: Vec<bool>,
}

/// The number of bits a key or message may have, or an error that names the limits.
pub fn check_bits(bits: usize) -> Result<usize> {
    if (1..=MAX_BITS).contains(&bits) {
        Ok(bits)
    } else {
        Err(Error::BadOption {
            field: "bits",
            reason: format!("{bits} is outside 1 to {MAX_BITS}"),
        })
    }
}

impl Message {
    /// A message of these bits, most significant first. Fails unless there are 1 to [`MAX_BITS`].
    pub fn from_bits(bits: Vec<bool>) -> Result<Self> {
        check_bits(bits.len())?;
        Ok(Self { bits })
    }

    /// Reads `length` bits from exactly ceil(`length` / 4) hexadecimal digits, with or without `0x`.
    ///
    /// # Errors
    /// Too few or too many digits, a digit that is none, or a value that needs more than `length` bits.
    pub fn parse(text: &str, length: usize) -> Result<Self> {
        check_bits(length)?;
        let bad = |reason: String| Error::BadOption {
            field: "message",
            reason,
        };
        let digits = text
            .strip_prefix("0x")
            .or_else(|| text.strip_prefix("0X"))
            .unwrap_or(text);
        let mut bits = Vec::with_capacity(length + 3);
        // The count is checked while reading, so that a hostile text costs no more than one pass.
        for (position, digit) in digits.chars().enumerate() {
            let value = digit.to_digit(16).ok_or_else(|| {
                bad(format!(
                    "character {} is {digit:?}, not a hexadecimal digit",
                    position + 1
                ))
            })?;
            if bits.len() <= MAX_BITS {
                bits.extend((0..4).rev().map(|shift| value >> shift & 1 == 1));
            }
        }
        let (count, wanted) = (digits.chars().count(), length.div_ceil(4));
        if count != wanted {
            let how = if count > wanted { "longer" } else { "shorter" };
            return Err(bad(format!(
                "{count} hexadecimal digits are {how} than the key's {length} bits, which take {wanted}"
            )));
        }
        let spare = bits.len() - length;
        if bits[..spare].contains(&true) {
            return Err(bad(format!("the value needs more than the key's {length} bits")));
        }
        Ok(Self {
            bits: bits.split_off(spare),
        })
    }

    /// `length` bits drawn from `rng`.
    pub fn random(length: usize, rng: &mut impl Rng) -> Result<Self> {
        check_bits(length)?;
        Ok(Self {
            bits: (0..length).map(|_| rng.next_u32() & 1 == 1).collect(),
        })
    }

    /// The message that logits decide for: a bit is 1 where its logit is positive.
    pub fn from_logits(logits: &[f32]) -> Result<Self> {
        Self::from_bits(logits.iter().map(|&logit| logit > 0.0).collect())
    }

    /// Bits, most significant first.
    pub fn bits(&self) -> &[bool] {
        &self.bits
    }

    /// Number of bits, at least 1.
    #[allow(clippy::len_without_is_empty)] // a message is never empty
    pub fn len(&self) -> usize {
        self.bits.len()
    }

    /// Number of equal bits. Bits that only one of the two has count as different.
    pub fn matches(&self, other: &Message) -> usize {
        self.bits.iter().zip(&other.bits).filter(|(a, b)| a == b).count()
    }

    /// [`Message::matches`] as a fraction of the longer message's bits.
    pub fn accuracy(&self, other: &Message) -> f64 {
        self.matches(other) as f64 / self.len().max(other.len()) as f64
    }

    /// The bits as the numbers 0 and 1, for a loss.
    pub fn targets(&self) -> impl Iterator<Item = f32> + '_ {
        self.bits.iter().map(|&bit| f32::from(u8::from(bit)))
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let first = self.bits.len() % 4;
        let head = (first > 0).then(|| &self.bits[..first]);
        for digit in head.into_iter().chain(self.bits[first..].chunks(4)) {
            let value = digit.iter().fold(0_u8, |value, &bit| value << 1 | u8::from(bit));
            write!(f, "{value:x}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn most_significant_bit_comes_first() {
        let message = Message::parse("8001", 16).unwrap();
        assert!(message.bits()[0] && message.bits()[15]);
        assert_eq!(message.bits().iter().filter(|&&b| b).count(), 2);
        assert_eq!(Message::parse("5", 3).unwrap().bits(), [true, false, true]);
    }

    #[test]
    fn hexadecimal_round_trip_at_every_length() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for length in 1..=MAX_BITS {
            let message = Message::random(length, &mut rng).unwrap();
            let text = message.to_string();
            assert_eq!(text.len(), length.div_ceil(4));
            assert_eq!(Message::parse(&text, length).unwrap(), message);
            assert_eq!(
                Message::parse(&format!("0x{}", text.to_uppercase()), length).unwrap(),
                message
            );
        }
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let reason = |text: &str, length| Message::parse(text, length).unwrap_err().to_string();
        assert!(reason("123456789", 32).contains("longer than the key's 32 bits"));
        assert!(reason("1234567", 32).contains("shorter"));
        assert!(reason("", 32).contains("shorter"));
        assert!(reason("1234567g", 32).contains("character 8 is 'g'"));
        assert!(reason("8", 3).contains("more than the key's 3 bits"));
        assert!(reason("0", 0).contains("1 to 150"));
        assert!(reason("0", 151).contains("1 to 150"));
        assert!(reason(&"f".repeat(1_000_000), 75).contains("1000000 hexadecimal digits"));
        assert!(reason("é", 4).contains("character 1"));
    }

    #[test]
    fn accuracy_counts_equal_bits() {
        let (a, b) = (Message::parse("f0", 8).unwrap(), Message::parse("f3", 8).unwrap());
        assert_eq!(a.matches(&b), 6);
        assert_eq!(a.accuracy(&b), 0.75);
        assert_eq!(a.accuracy(&Message::parse("f", 4).unwrap()), 0.5);
    }

    #[test]
    fn logits_decide_by_sign() {
        assert_eq!(
            Message::from_logits(&[1.0, -1.0, 0.0, f32::NAN, 2.0])
                .unwrap()
                .to_string(),
            "11"
        );
        assert!(Message::from_logits(&[]).is_err());
    }
}
