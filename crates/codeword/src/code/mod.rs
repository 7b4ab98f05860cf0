//! Codes of 64 bits: what is put into a mark so that its payload survives wrong bits.
//!
//! Error correction reads, it never decides: [`Code::decode`] accepts 8.3 %, 3.1 % and 0.5 % of random words.
mod bch;
mod field;
mod payload;
mod scheme;
mod soft;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::message::{Message, MessageLength};
use crate::reading::Reading;
use bch::Bch;
pub use payload::{Layout, Payload};
pub use scheme::{PAPER_LENGTHS, Scheme};

/// A BCH code of 63 bits with one overall parity bit behind it.
///
/// Bits, most significant first: information, check bits, parity. The minimum distances are 8, 12 and 14.
///
/// Marks are read with 1 to 5 % of wrong bits after views are pooled. Payloads lost then, by the bits alone (exactly,
/// P(Bin(64, rate) > t)) and by logits (of 1,500 to 5,500 words with Gaussian ones, `examples/compare_codes.rs`):
///
/// | code | 1 % | 2 % | 3 % | 5 % | logits, 3 % | logits, 5 % |
/// |---|---|---|---|---|---|---|
/// | (63, 45) | 3.9e-3 | 3.9e-2 | 1.3e-1 | 4.0e-1 | 3e-3 | 3.5e-2 |
/// | (63, 36) | 4.6e-5 | 1.8e-3 | 1.2e-2 | 1.0e-1 | below 2e-3 | 2e-3 |
/// | (63, 30) | 3.8e-6 | 2.9e-4 | 3.0e-3 | 4.0e-2 | below 2e-3 | 7e-4 |
///
/// The default is (63, 36): a thousand keys of sixteen million payloads each, and at 5 % one payload of 500 lost, where
/// (63, 45) loses one of 30. (63, 30) loses still fewer, but has room for 256 keys of a million payloads only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// (63, 45), corrects 3 bits.
    Bch45,
    /// (63, 36), corrects 5 bits.
    #[default]
    Bch36,
    /// (63, 30), corrects 6 bits.
    Bch30,
}

/// What was decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// Information bits, in the lowest [`Code::information_bits`].
    pub information: u64,
    /// The codeword.
    pub codeword: Message,
    /// Decided bits that were read otherwise.
    pub corrected_bits: u32,
    /// Undecided bits that the code filled in.
    pub filled_bits: u32,
}

impl Code {
    /// All codes.
    pub const ALL: [Self; 3] = [Self::Bch45, Self::Bch36, Self::Bch30];

    /// Information bits.
    pub fn information_bits(self) -> u32 {
        self.bch().k
    }

    /// Wrong bits, of 64, that are always corrected.
    pub fn corrects(self) -> u32 {
        self.bch().t
    }

    /// The codeword of information bits.
    ///
    /// # Errors
    /// [`Error::TooLarge`] for more than [`Code::information_bits`].
    pub fn encode(self, information: u64) -> Result<Message> {
        let limit = (1 << self.information_bits()) - 1;
        if information > limit {
            return Err(Error::TooLarge {
                field: "information bits",
                value: information,
                limit,
            });
        }
        Ok(Message::from_u64(extend(self.bch().encode(information))))
    }

    /// The codeword of a payload.
    ///
    /// # Errors
    /// Those of [`Payload::pack`].
    pub fn codeword(self, payload: Payload) -> Result<Message> {
        self.encode(payload.pack(self)?)
    }

    /// The codeword within [`Code::corrects`] bits of a word, if there is one; the word's logits are not asked.
    ///
    /// # Errors
    /// [`Error::OtherLength`] unless the word has 64 bits.
    pub fn decode(self, word: &Message) -> Result<Option<Decoded>> {
        let value = coded(word)?;
        let near = self
            .nearest(value)
            .filter(|codeword| (codeword ^ value).count_ones() <= self.corrects());
        Ok(near.map(|codeword| self.decoded(codeword, value, u64::MAX)))
    }

    /// The likeliest codeword for logits, one a bit, if one is found, by Chase's algorithm.
    ///
    /// A logit above 0 speaks for a 1, by its size; 0 and NaN say nothing. Corrects what [`Code::decode`] corrects when
    /// all logits are of one size, and more when wrong bits are the unsure ones: measured on Gaussian logits with up to 5 %
    /// of wrong bits, a tenth as many payloads are lost, or fewer; 0.2 ms a word.
    ///
    /// Where this fails it mostly finds another codeword instead of none, so that what was read must be compared with
    /// the registry before it is believed.
    ///
    /// # Errors
    /// [`Error::OtherLength`] unless there are 64 logits.
    pub fn decode_logits(self, logits: &[f32]) -> Result<Option<Decoded>> {
        let reading = Reading::from_logits(logits)?;
        let value = coded(&reading.message())?;
        let decided = reading.limbs().1[0];
        Ok(soft::nearest(self, value, logits).map(|codeword| self.decoded(codeword, value, decided)))
    }

    /// The extended codeword whose first 63 bits lie within t of those of `value`.
    fn nearest(self, value: u64) -> Option<u64> {
        self.bch().correct(value >> 1).map(extend)
    }

    fn decoded(self, codeword: u64, read: u64, decided: u64) -> Decoded {
        Decoded {
            information: self.bch().information(codeword >> 1),
            codeword: Message::from_u64(codeword),
            corrected_bits: ((codeword ^ read) & decided).count_ones(),
            filled_bits: (!decided).count_ones(),
        }
    }

    fn bch(self) -> Bch {
        match self {
            Self::Bch45 => Bch::T3,
            Self::Bch36 => Bch::T5,
            Self::Bch30 => Bch::T6,
        }
    }
}

/// The codeword of up to 16 bits, in the lowest of `information`, in the extended code (64, 16).
pub fn short_codeword(information: u64) -> u64 {
    extend(Bch::T11.encode(information))
}

/// 63 bits with their parity behind.
fn extend(codeword: u64) -> u64 {
    codeword << 1 | u64::from(codeword.count_ones() & 1)
}

/// The integer of a word of 64 bits.
fn coded(word: &Message) -> Result<u64> {
    word.to_u64().ok_or_else(|| Error::OtherLength {
        what: "a coded word".into(),
        bits: word.length().bits(),
        expected: MessageLength::CODED.bits(),
    })
}
