//! Whitening: a secret pad over a codeword, different for every asset.
//!
//! Under the pad a word is uniform for whoever lacks the secret, which is all that the p-values of [`crate::chance`]
//! suppose; and words that several assets of one owner carry have nothing in common.
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::code::Code;
use crate::code::Payload;
use crate::error::{Error, Result};
use crate::limits::MAX_BITS;
use crate::message::{Message, MessageLength};

/// Fewest bytes of a nonce.
pub const NONCE_BYTES: usize = 16;

/// Keeps pads apart from everything else that is derived from a secret.
const DOMAIN: &[u8] = b"guardsplat codeword pad v1";

// One block of the function is enough for the longest word.
const _: () = assert!(MAX_BITS <= 256);

/// What a pad is made from.
#[derive(Clone, Copy)]
pub struct Whitening<'a> {
    /// The owner's secret. Its length is fixed because HMAC doesn't tell keys apart that differ in zeros at their end.
    pub secret: &'a [u8; 32],
    /// The asset's identity, such as its hash; at least a byte.
    pub asset: &'a [u8],
    /// Random bytes drawn for this mark, at least [`NONCE_BYTES`]. Not secret, but never used twice.
    pub nonce: &'a [u8],
}

/// A word to embed, and the pad that is on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// What is embedded: the codeword under the pad.
    pub word: Message,
    /// The pad; secret.
    pub pad: Message,
}

impl Whitening<'_> {
    /// The pad for words of a length: the first bits of HMAC-SHA256 under the secret, over domain, asset and nonce, each
    /// behind its length as 8 bytes, and the word's length in bits as 8 bytes, all big-endian.
    ///
    /// # Errors
    /// [`Error::TooShort`] for an empty asset or a nonce below [`NONCE_BYTES`].
    pub fn pad(&self, length: MessageLength) -> Result<Message> {
        require("asset", self.asset, 1)?;
        require("nonce", self.nonce, NONCE_BYTES)?;
        // A key of a whole block: HMAC itself puts zeros behind shorter ones, and this way nothing can fail.
        let mut block = [0; 64];
        block.iter_mut().zip(self.secret).for_each(|(to, from)| *to = *from);
        let mut mac = Hmac::<Sha256>::new(&block.into());
        for part in [DOMAIN, self.asset, self.nonce] {
            mac.update(&(part.len() as u64).to_be_bytes());
            mac.update(part);
        }
        mac.update(&u64::from(length.bits()).to_be_bytes());
        Message::from_bytes(&mac.finalize().into_bytes(), length).ok_or(Error::Length {
            bits: length.bits() as usize,
        })
    }
}

impl std::fmt::Debug for Whitening<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Whitening(..)") // no secrets in logs
    }
}

/// The word to embed for a payload.
///
/// # Errors
/// Those of [`Payload::pack`] and [`Whitening::pad`].
pub fn mark(code: Code, payload: Payload, whitening: &Whitening<'_>) -> Result<Mark> {
    let pad = whitening.pad(MessageLength::CODED)?;
    let word = code.codeword(payload)?.xor(&pad)?;
    Ok(Mark { word, pad })
}

fn require(field: &'static str, bytes: &[u8], least: usize) -> Result<()> {
    if bytes.len() >= least {
        return Ok(());
    }
    Err(Error::TooShort {
        field,
        bytes: bytes.len(),
        least,
    })
}
