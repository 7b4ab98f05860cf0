//! How the messages of a key become the words that are embedded, and how words are read as messages again.
//!
//! A message of up to 16 bits is put into a codeword of 64 bits, so that a fifth of them may be read
//! wrong; longer ones are embedded bit by bit. Codewords are those of the extended BCH code (64, 16), which differ in 24 bits
//! at least. What is read is the likeliest message of all, by every codeword's sum of logits: maximum-likelihood decoding
//! where noise is Gaussian (Lin and Costello, Error Control Coding, 2nd edition, section 10.1).
//!
//! A pad of the key is over all its words, so that of a scene that was made without the key every bit of a word matches as a
//! thrown coin would, and p-values have 64 bits to count.
use std::fmt;
use std::sync::OnceLock;

use crate::code::short_codeword;
use crate::error::{Error, Result};
use crate::message::{Message, MessageLength};
use crate::reading::Reading;

/// Longest message that is coded, in bits.
const CODED_MESSAGE_BITS: u32 = 16;

/// Between messages and words.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum MessageCode {
    /// A word is the message itself.
    Plain,
    /// A word is a codeword of 64 bits under a pad.
    Coded {
        /// Bits of a message, at most 16.
        length: MessageLength,
        /// The pad; secret.
        pad: Message,
    },
}

impl fmt::Debug for MessageCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plain => f.write_str("Plain"),
            Self::Coded { length, .. } => write!(f, "Coded({} bits, ..)", length.bits()),
        }
    }
}

impl MessageCode {
    /// Whether messages of so many bits are coded.
    pub fn is_for(bits: usize) -> bool {
        (1..=CODED_MESSAGE_BITS as usize).contains(&bits)
    }

    /// Codewords of messages of `bits` bits, under a secret pad.
    ///
    /// # Errors
    /// [`Error::Length`] for no bits, [`Error::TooLarge`] for more than 16.
    pub fn coded(bits: usize, pad: u64) -> Result<Self> {
        let length = MessageLength::new(bits)?;
        if !Self::is_for(bits) {
            return Err(Error::TooLarge {
                field: "bits of a coded message",
                value: bits as u64,
                limit: u64::from(CODED_MESSAGE_BITS),
            });
        }
        Ok(Self::Coded {
            length,
            pad: Message::from_u64(pad),
        })
    }

    /// How many messages there are, where one that is read by itself can be judged: all of them were tried.
    pub fn messages(&self) -> Option<u64> {
        match self {
            Self::Plain => None,
            Self::Coded { length, .. } => Some(1 << length.bits()),
        }
    }

    /// The word of a message.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for a message that is not of the code's length.
    pub fn word(&self, message: &Message) -> Result<Message> {
        match self {
            Self::Plain => Ok(*message),
            Self::Coded { length, pad } => {
                Message::zeros(*length).require("the message", message)?;
                Message::from_u64(short_codeword(message.limbs()[0])).xor(pad)
            }
        }
    }

    /// The likeliest message for logits, one a bit of a word: above 0 for a 1. 0 and NaN say nothing; of a message that is
    /// embedded bit by bit they read 0.
    ///
    /// # Errors
    /// [`Error::Length`] and [`Error::OtherLength`] for logits that are not as many as a word has bits.
    pub fn read(&self, logits: &[f32]) -> Result<Message> {
        match self {
            Self::Plain => Ok(Reading::from_logits(logits)?.message()),
            Self::Coded { length, pad } => {
                let sums = Sums::of(logits, pad)?;
                let words = codewords(*length).iter().enumerate();
                let best = words.fold((0, f64::NEG_INFINITY), |best, (value, word)| {
                    let sum = sums.over(*word);
                    if sum > best.1 { (value, sum) } else { best }
                });
                Ok(Message::from_integer(best.0 as u64, *length))
            }
        }
    }

    /// Bits of `message` that logits read wrong, or, of one that is embedded bit by bit, leave undecided.
    ///
    /// # Errors
    /// Those of [`MessageCode::read`], and [`Error::OtherLength`] for a message of another length.
    pub fn wrong_bits(&self, logits: &[f32], message: &Message) -> Result<u32> {
        match self {
            Self::Plain => Ok(message.length().bits() - Reading::from_logits(logits)?.matches(message)?),
            Self::Coded { .. } => Ok(self.read(logits)?.xor(message)?.count_ones()),
        }
    }

    /// By how much logits read `message` and no other: of the message that is nearest to being read instead, the mean logit of
    /// the bits in which the words differ, positive for `message`. Bit by bit that is the weakest bit.
    ///
    /// # Errors
    /// Those of [`MessageCode::wrong_bits`].
    pub fn margin(&self, logits: &[f32], message: &Message) -> Result<f64> {
        let word = self.word(message)?;
        match self {
            Self::Plain => {
                Message::zeros(MessageLength::new(logits.len())?).require("the message", message)?;
                let signed = logits.iter().zip(word.bits());
                let signed = signed.map(|(&logit, bit)| f64::from(if bit { logit } else { -logit }));
                Ok(signed.fold(f64::INFINITY, f64::min))
            }
            Self::Coded { length, pad } => {
                let sums = Sums::of(logits, pad)?;
                let own = short_codeword(message.limbs()[0]);
                let sum = sums.over(own);
                let others = codewords(*length).iter().filter(|word| **word != own);
                let margins = others.map(|word| (sum - sums.over(*word)) / f64::from((word ^ own).count_ones()));
                Ok(margins.fold(f64::INFINITY, f64::min))
            }
        }
    }
}

/// Codewords of the messages of a length, in their order.
fn codewords(length: MessageLength) -> &'static [u64] {
    static ALL: OnceLock<Vec<u64>> = OnceLock::new();
    let all = ALL.get_or_init(|| (0..1 << CODED_MESSAGE_BITS).map(short_codeword).collect());
    &all[..1 << length.bits().min(CODED_MESSAGE_BITS)]
}

/// Sums of logits over the ones of each byte of a codeword: eight numbers are a codeword's sum.
struct Sums([[f64; 256]; 8]);

impl Sums {
    /// Of logits of words under `pad`.
    fn of(logits: &[f32], pad: &Message) -> Result<Self> {
        if logits.len() != pad.len() {
            return Err(Error::OtherLength {
                what: "a coded word".into(),
                bits: logits.len() as u32,
                expected: pad.length().bits(),
            });
        }
        let mut sums = [[0.0; 256]; 8];
        for (position, (&logit, flipped)) in logits.iter().zip(pad.bits()).enumerate() {
            // NaN says nothing; sums of the largest sizes stay finite.
            let logit = if logit.is_nan() {
                0.0
            } else {
                f64::from(logit).clamp(-1e30, 1e30)
            };
            let (byte, bit) = (position / 8, 1 << (7 - position % 8));
            for (value, sum) in sums[byte].iter_mut().enumerate() {
                if value & bit != 0 {
                    *sum += if flipped { -logit } else { logit };
                }
            }
        }
        Ok(Self(sums))
    }

    /// Over the ones of a codeword.
    fn over(&self, codeword: u64) -> f64 {
        let bytes = codeword.to_be_bytes();
        self.0
            .iter()
            .zip(bytes)
            .map(|(sums, byte)| sums[usize::from(byte)])
            .sum()
    }
}

#[cfg(test)]
mod tests;
