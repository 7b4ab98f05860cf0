//! Messages of up to 150 bits, most significant first, told in hexadecimal.
//!
//! A codeword, a pad and whatever else is embedded or read bit by bit are messages, too.
use std::fmt;

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::limits::MAX_BITS;

/// Limbs of 64 bits that hold [`MAX_BITS`].
pub(crate) const LIMBS: usize = MAX_BITS.div_ceil(64) as usize;

/// The number of bits of a message, 1 to [`MAX_BITS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct MessageLength(u8);

impl MessageLength {
    /// A length of 64, that of the codes.
    pub const CODED: Self = Self(64);

    /// A checked length.
    ///
    /// # Errors
    /// [`Error::Length`] outside 1 to [`MAX_BITS`].
    pub fn new(bits: usize) -> Result<Self> {
        match u8::try_from(bits) {
            Ok(small) if small > 0 && u32::from(small) <= MAX_BITS => Ok(Self(small)),
            _ => Err(Error::Length { bits }),
        }
    }

    /// The number of bits.
    pub fn bits(self) -> u32 {
        u32::from(self.0)
    }

    /// Limbs of 64 bits that a message of this length takes, 1 to 3.
    pub(crate) fn limbs(self) -> usize {
        usize::from(self.0).div_ceil(64)
    }
}

impl TryFrom<u32> for MessageLength {
    type Error = Error;

    fn try_from(bits: u32) -> Result<Self> {
        Self::new(bits as usize)
    }
}

impl From<MessageLength> for u32 {
    fn from(length: MessageLength) -> Self {
        length.bits()
    }
}

/// Bits, most significant first; never empty and never longer than [`MAX_BITS`].
///
/// Serialised as its length and its hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Message {
    length: MessageLength,
    /// The message as an integer, least significant limb first. What lies above the length is 0.
    limbs: [u64; LIMBS],
}

/// A message as reports hold it.
#[derive(Serialize, Deserialize)]
struct Written {
    bits: MessageLength,
    hex: String,
}

impl Message {
    /// A message of zeros.
    pub fn zeros(length: MessageLength) -> Self {
        Self {
            length,
            limbs: [0; LIMBS],
        }
    }

    /// A message of these bits, most significant first.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are 1 to [`MAX_BITS`].
    pub fn from_bits(bits: &[bool]) -> Result<Self> {
        let mut message = Self::zeros(MessageLength::new(bits.len())?);
        for (position, &bit) in bits.iter().enumerate() {
            message.set(position as u32, bit);
        }
        Ok(message)
    }

    /// The first `length` bits of `bytes`, most significant first, or `None` when there are not so many.
    pub(crate) fn from_bytes(bytes: &[u8], length: MessageLength) -> Option<Self> {
        let mut message = Self::zeros(length);
        for position in 0..length.bits() {
            let byte = bytes.get(position as usize / 8)?;
            message.set(position, byte >> (7 - position % 8) & 1 == 1);
        }
        Some(message)
    }

    /// The 64 bits of an integer, most significant first.
    pub fn from_u64(value: u64) -> Self {
        Self::from_integer(value, MessageLength::CODED)
    }

    /// The lowest bits of an integer, as many as the length, of which there are at most 64.
    pub(crate) fn from_integer(value: u64, length: MessageLength) -> Self {
        let mut message = Self::zeros(length);
        let unused = 64_u32.saturating_sub(length.bits());
        message.limbs[0] = value << unused >> unused;
        message
    }

    /// The integer of a message of 64 bits; `None` for other lengths.
    pub fn to_u64(&self) -> Option<u64> {
        (self.length == MessageLength::CODED).then_some(self.limbs[0])
    }

    /// Reads `bits` bits from exactly ceil(`bits` / 4) hexadecimal digits, with or without `0x`.
    ///
    /// # Errors
    /// [`Error::Length`], and [`Error::Digits`] for too few or too many digits, one that is none, or a value that needs
    /// more than `bits` bits.
    pub fn parse(text: &str, bits: usize) -> Result<Self> {
        let length = MessageLength::new(bits)?;
        let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
        Self::from_digits(digits.unwrap_or(text), length)
    }

    fn from_digits(digits: &str, length: MessageLength) -> Result<Self> {
        let bad = |reason: String| Err(Error::Digits { reason });
        let (bits, wanted) = (length.bits(), length.bits().div_ceil(4) as usize);
        let wrong = digits.chars().enumerate().find(|(_, c)| !c.is_ascii_hexdigit());
        if let Some((index, digit)) = wrong {
            return bad(format!("character {} is {digit:?}, not a hexadecimal digit", index + 1));
        }
        let count = digits.len();
        if count != wanted {
            let how = if count > wanted { "longer" } else { "shorter" };
            return bad(format!(
                "{count} hexadecimal digits are {how} than the key's {bits} bits, which take {wanted}"
            ));
        }
        let spare = wanted as u32 * 4 - bits;
        let mut message = Self::zeros(length);
        for (index, value) in digits.chars().filter_map(|digit| digit.to_digit(16)).enumerate() {
            for bit in 0..4 {
                let set = value >> (3 - bit) & 1 == 1;
                match (4 * index as u32 + bit).checked_sub(spare) {
                    Some(position) => message.set(position, set),
                    None if set => return bad(format!("the value needs more than the key's {bits} bits")),
                    None => {}
                }
            }
        }
        Ok(message)
    }

    /// `bits` bits drawn from `rng`: the lowest of one 32-bit number each, most significant first.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are 1 to [`MAX_BITS`].
    pub fn random(bits: usize, rng: &mut impl Rng) -> Result<Self> {
        let mut message = Self::zeros(MessageLength::new(bits)?);
        for position in 0..message.length.bits() {
            message.set(position, rng.next_u32() & 1 == 1);
        }
        Ok(message)
    }

    /// The number of bits.
    pub fn length(&self) -> MessageLength {
        self.length
    }

    /// The number of bits, at least 1.
    #[allow(clippy::len_without_is_empty)] // a message is never empty
    pub fn len(&self) -> usize {
        self.length.bits() as usize
    }

    /// Bits, most significant first.
    pub fn bits(&self) -> impl Iterator<Item = bool> + '_ {
        (0..self.length.bits()).map(|position| self.get(position))
    }

    /// Bits that are 1.
    pub fn count_ones(&self) -> u32 {
        self.limbs.iter().map(|limb| limb.count_ones()).sum()
    }

    /// The bits as the numbers 0 and 1, for a loss.
    pub fn targets(&self) -> impl Iterator<Item = f32> + '_ {
        self.bits().map(|bit| f32::from(u8::from(bit)))
    }

    /// Bits that differ between two messages, as a message.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for messages of different lengths.
    pub fn xor(&self, other: &Message) -> Result<Message> {
        self.require("the other message", other)?;
        let mut message = *self;
        message.limbs.iter_mut().zip(other.limbs).for_each(|(a, b)| *a ^= b);
        Ok(message)
    }

    /// Fails unless `other`, called `what` in the message, is of the same length.
    pub(crate) fn require(&self, what: &str, other: &Message) -> Result<()> {
        if self.length == other.length {
            return Ok(());
        }
        Err(Error::OtherLength {
            what: what.into(),
            bits: other.length.bits(),
            expected: self.length.bits(),
        })
    }

    /// The message as an integer, least significant limb first; zeros follow.
    pub(crate) fn limbs(&self) -> &[u64; LIMBS] {
        &self.limbs
    }

    /// The bit at a position counted from the most significant; false behind the end.
    pub(crate) fn get(&self, position: u32) -> bool {
        let Some(place) = self.place(position) else {
            return false;
        };
        self.limbs[place / 64] >> (place % 64) & 1 == 1
    }

    /// Sets the bit at a position counted from the most significant; nothing behind the end.
    pub(crate) fn set(&mut self, position: u32, bit: bool) {
        let Some(place) = self.place(position) else { return };
        let limb = &mut self.limbs[place / 64];
        *limb = *limb & !(1 << (place % 64)) | u64::from(bit) << (place % 64);
    }

    fn place(&self, position: u32) -> Option<usize> {
        Some(self.length.bits().checked_sub(position + 1)? as usize)
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = self.length.bits().div_ceil(4) as usize;
        for digit in (0..digits).rev() {
            write!(f, "{:x}", self.limbs[digit / 16] >> (digit % 16 * 4) & 15)?;
        }
        Ok(())
    }
}

impl TryFrom<Written> for Message {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self> {
        Self::from_digits(&written.hex, written.bits)
    }
}

impl From<Message> for Written {
    fn from(message: Message) -> Self {
        Self {
            bits: message.length,
            hex: message.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn most_significant_bits_come_first() {
        let word = Message::from_bits(&[true, false, false, false, false, true]).unwrap();
        assert_eq!(word.to_string(), "21");
        assert_eq!(Message::from_u64(1 << 63).bits().position(|bit| bit), Some(0));
        assert_eq!(Message::from_u64(0xa5).to_string(), "00000000000000a5");
        let bytes = Message::from_bytes(&[0x80, 0xff], MessageLength::new(9).unwrap()).unwrap();
        assert_eq!(bytes.to_string(), "101");
        assert_eq!(Message::from_bytes(&[0x80], MessageLength::new(9).unwrap()), None);
    }

    #[test]
    fn what_is_no_message_is_an_error() {
        for bits in [0, 151, 256, usize::MAX] {
            assert_eq!(
                Message::from_bits(&vec![true; bits.min(300)]).is_err(),
                MessageLength::new(bits).is_err()
            );
            assert_eq!(MessageLength::new(bits), Err(Error::Length { bits }));
            assert!(Message::random(bits, &mut ChaCha8Rng::seed_from_u64(1)).is_err());
        }
        let reason = |text: &str, bits| Message::parse(text, bits).unwrap_err().to_string();
        assert!(reason("123456789", 32).contains("longer than the key's 32 bits"));
        assert!(reason("1234567", 32).contains("shorter"));
        assert!(reason("", 32).contains("shorter"));
        assert!(reason("0x", 4).contains("shorter"));
        assert!(reason("1234567g", 32).contains("character 8 is 'g'"));
        assert!(reason("8", 3).contains("more than the key's 3 bits"));
        assert!(reason("2", 1).contains("more than the key's 1 bits"));
        assert!(reason("0", 0).contains("1 to 150"));
        assert!(reason("0", 151).contains("1 to 150"));
        assert!(reason(&"f".repeat(1_000_000), 75).contains("1000000 hexadecimal digits"));
        assert!(reason("é", 4).contains("character 1"));
        for text in [
            r#"{"bits":0,"hex":""}"#,
            r#"{"bits":4,"hex":"10"}"#,
            r#"{"bits":4,"hex":"0x1"}"#,
        ] {
            assert!(serde_json::from_str::<Message>(text).is_err());
        }
        let six = MessageLength::new(6).unwrap();
        assert!(Message::from_u64(1).xor(&Message::zeros(six)).is_err());
    }

    #[test]
    fn random_messages_are_what_they_always_were() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn = Message::random(64, &mut rng).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let bits: Vec<bool> = (0..64).map(|_| rng.next_u32() & 1 == 1).collect();
        assert_eq!(drawn, Message::from_bits(&bits).unwrap());
        assert_eq!(drawn.targets().map(|target| target > 0.5).collect::<Vec<_>>(), bits);
    }

    proptest! {
        #[test]
        fn bits_come_back_from_text_and_json(bits in prop::collection::vec(any::<bool>(), 1..=150)) {
            let word = Message::from_bits(&bits).unwrap();
            prop_assert_eq!(word.bits().collect::<Vec<_>>(), bits.clone());
            prop_assert_eq!(word.count_ones() as usize, bits.iter().filter(|&&bit| bit).count());
            prop_assert_eq!(Message::parse(&word.to_string(), word.len()).unwrap(), word);
            let upper = format!("0x{}", word.to_string().to_uppercase());
            prop_assert_eq!(Message::parse(&upper, word.len()).unwrap(), word);
            let json = serde_json::to_string(&word).unwrap();
            prop_assert_eq!(serde_json::from_str::<Message>(&json).unwrap(), word);
            prop_assert_eq!(word.xor(&word).unwrap().count_ones(), 0);
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,40}", bits in 1_usize..=150) {
            if let Ok(message) = Message::parse(&text, bits) {
                let digits = text.to_lowercase();
                prop_assert_eq!(message.to_string(), digits.strip_prefix("0x").unwrap_or(&digits));
            }
        }
    }
}
