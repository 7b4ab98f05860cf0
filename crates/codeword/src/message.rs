//! Words of up to 150 bits, most significant first, told in hexadecimal.
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Most bits that a word can have: what the token tables of keys have room for.
pub const MAX_BITS: u32 = 150;

/// Limbs of 64 bits that hold [`MAX_BITS`].
pub(crate) const LIMBS: usize = MAX_BITS.div_ceil(64) as usize;

/// The number of bits of a word, 1 to [`MAX_BITS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct WordLength(u8);

impl WordLength {
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

    /// Limbs of 64 bits that a word of this length takes, 1 to 3.
    pub(crate) fn limbs(self) -> usize {
        usize::from(self.0).div_ceil(64)
    }
}

impl TryFrom<u32> for WordLength {
    type Error = Error;

    fn try_from(bits: u32) -> Result<Self> {
        Self::new(bits as usize)
    }
}

impl From<WordLength> for u32 {
    fn from(length: WordLength) -> Self {
        length.bits()
    }
}

/// Bits, most significant first; never empty and never longer than [`MAX_BITS`].
///
/// Serialised as its length and its hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Word {
    length: WordLength,
    /// The word as an integer, least significant limb first. What lies above the length is 0.
    limbs: [u64; LIMBS],
}

/// A word as reports hold it.
#[derive(Serialize, Deserialize)]
struct Written {
    bits: WordLength,
    hex: String,
}

impl Word {
    /// A word of zeros.
    pub fn zeros(length: WordLength) -> Self {
        Self {
            length,
            limbs: [0; LIMBS],
        }
    }

    /// A word of these bits, most significant first.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are 1 to [`MAX_BITS`].
    pub fn from_bits(bits: &[bool]) -> Result<Self> {
        let mut word = Self::zeros(WordLength::new(bits.len())?);
        for (position, &bit) in bits.iter().enumerate() {
            word.set(position as u32, bit);
        }
        Ok(word)
    }

    /// The first `length` bits of `bytes`, most significant first, or `None` when there are not so many.
    pub(crate) fn from_bytes(bytes: &[u8], length: WordLength) -> Option<Self> {
        let mut word = Self::zeros(length);
        for position in 0..length.bits() {
            let byte = bytes.get(position as usize / 8)?;
            word.set(position, byte >> (7 - position % 8) & 1 == 1);
        }
        Some(word)
    }

    /// The 64 bits of an integer, most significant first.
    pub fn from_u64(value: u64) -> Self {
        let mut word = Self::zeros(WordLength::CODED);
        word.limbs[0] = value;
        word
    }

    /// The integer of a word of 64 bits; `None` for other lengths.
    pub fn to_u64(&self) -> Option<u64> {
        (self.length == WordLength::CODED).then_some(self.limbs[0])
    }

    /// Reads a word from exactly ceil(`length` / 4) hexadecimal digits, without a prefix.
    ///
    /// # Errors
    /// [`Error::Digits`] for too few or too many digits, one that is none, or a value that needs more bits.
    pub fn parse(text: &str, length: WordLength) -> Result<Self> {
        let bad = |reason: String| Error::Digits { reason };
        let (count, wanted) = (text.chars().count(), length.bits().div_ceil(4) as usize);
        if count != wanted {
            return Err(bad(format!(
                "{count} hexadecimal digits, but {} bits take {wanted}",
                length.bits()
            )));
        }
        let spare = wanted as u32 * 4 - length.bits();
        let mut word = Self::zeros(length);
        for (index, digit) in text.chars().enumerate() {
            let value = digit
                .to_digit(16)
                .ok_or_else(|| bad(format!("character {} is {digit:?}, not a hexadecimal digit", index + 1)))?;
            for bit in 0..4 {
                let set = value >> (3 - bit) & 1 == 1;
                match (4 * index as u32 + bit).checked_sub(spare) {
                    Some(position) => word.set(position, set),
                    None if set => return Err(bad(format!("the value needs more than {} bits", length.bits()))),
                    None => {}
                }
            }
        }
        Ok(word)
    }

    /// The number of bits.
    pub fn length(&self) -> WordLength {
        self.length
    }

    /// Bits, most significant first.
    pub fn bits(&self) -> impl Iterator<Item = bool> + '_ {
        (0..self.length.bits()).map(|position| self.get(position))
    }

    /// Bits that are 1.
    pub fn count_ones(&self) -> u32 {
        self.limbs.iter().map(|limb| limb.count_ones()).sum()
    }

    /// Bits that differ between two words, as a word.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for words of different lengths.
    pub fn xor(&self, other: &Word) -> Result<Word> {
        self.require("the other word", other)?;
        let mut word = *self;
        word.limbs.iter_mut().zip(other.limbs).for_each(|(a, b)| *a ^= b);
        Ok(word)
    }

    /// Fails unless `other`, called `what` in the message, is of the same length.
    pub(crate) fn require(&self, what: &str, other: &Word) -> Result<()> {
        if self.length == other.length {
            return Ok(());
        }
        Err(Error::OtherLength {
            what: what.into(),
            bits: other.length.bits(),
            expected: self.length.bits(),
        })
    }

    /// The word as an integer, least significant limb first; zeros follow.
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

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = self.length.bits().div_ceil(4) as usize;
        for digit in (0..digits).rev() {
            write!(f, "{:x}", self.limbs[digit / 16] >> (digit % 16 * 4) & 15)?;
        }
        Ok(())
    }
}

impl TryFrom<Written> for Word {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self> {
        Self::parse(&written.hex, written.bits)
    }
}

impl From<Word> for Written {
    fn from(word: Word) -> Self {
        Self {
            bits: word.length,
            hex: word.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn most_significant_bits_come_first() {
        let word = Word::from_bits(&[true, false, false, false, false, true]).unwrap();
        assert_eq!(word.to_string(), "21");
        assert_eq!(Word::from_u64(1 << 63).bits().position(|bit| bit), Some(0));
        assert_eq!(Word::from_u64(0xa5).to_string(), "00000000000000a5");
        let bytes = Word::from_bytes(&[0x80, 0xff], WordLength::new(9).unwrap()).unwrap();
        assert_eq!(bytes.to_string(), "101");
        assert_eq!(Word::from_bytes(&[0x80], WordLength::new(9).unwrap()), None);
    }

    #[test]
    fn what_is_no_word_is_an_error() {
        for bits in [0, 151, 256, usize::MAX] {
            assert_eq!(
                Word::from_bits(&vec![true; bits.min(300)]).is_err(),
                WordLength::new(bits).is_err()
            );
            assert_eq!(WordLength::new(bits), Err(Error::Length { bits }));
        }
        let six = WordLength::new(6).unwrap();
        for (text, part) in [
            ("1", "1 hexadecimal digits, but 6 bits take 2"),
            ("40", "more than 6"),
            ("1g", "'g'"),
        ] {
            let error = Word::parse(text, six).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        assert!(serde_json::from_str::<Word>(r#"{"bits":0,"hex":""}"#).is_err());
        assert!(serde_json::from_str::<Word>(r#"{"bits":4,"hex":"10"}"#).is_err());
        assert!(Word::from_u64(1).xor(&Word::zeros(six)).is_err());
    }

    proptest! {
        #[test]
        fn bits_come_back_from_text_and_json(bits in prop::collection::vec(any::<bool>(), 1..=150)) {
            let word = Word::from_bits(&bits).unwrap();
            prop_assert_eq!(word.bits().collect::<Vec<_>>(), bits.clone());
            prop_assert_eq!(word.count_ones() as usize, bits.iter().filter(|&&bit| bit).count());
            prop_assert_eq!(Word::parse(&word.to_string(), word.length()).unwrap(), word);
            let json = serde_json::to_string(&word).unwrap();
            prop_assert_eq!(serde_json::from_str::<Word>(&json).unwrap(), word);
            prop_assert_eq!(word.xor(&word).unwrap().count_ones(), 0);
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,40}", bits in 1_usize..=150) {
            let length = WordLength::new(bits).unwrap();
            if let Ok(word) = Word::parse(&text, length) {
                prop_assert_eq!(word.to_string(), text.to_lowercase());
            }
        }
    }
}
