//! What a mark says, how it is protected from errors, and the exact test that a copyright claim rests on.
//!
//! A [`MessageCode`] puts the short messages of a key into longer words. Of an asset a [`Payload`] is packed into a codeword
//! of a [`Code`], and whitened by a secret pad ([`Whitening`]). What is read back are logits, summed per bit over views, under
//! each [`Hypothesis`] about what was done to a picture. A [`Claim`] compares the words that they decide for with whitened
//! words, and asks the [`AcceptanceRule`] whether chance explains so many matches of bits read so clearly: error correction
//! reads the payload and never decides. [`Index`] finds the nearest of many registered words.
//!
//! Nothing here needs tensors, threads or files, so that server, worker and client all use the same code.
mod acceptance;
pub mod chance;
mod claim;
mod code;
mod decision;
mod error;
mod hypothesis;
mod limits;
mod message;
mod message_code;
mod reading;
mod search;
mod shares;
pub mod signed_rank;
mod whiten;

/// The code that assets are marked with: 2 bits of version, 10 of the key and 24 of the payload number in 64.
pub const MARK_CODE: Code = Code::Bch36;

pub use acceptance::{AcceptanceRule, DEFAULT_FALSE_POSITIVE_RATE, Verdict};
pub use claim::{Answer, Claim, Comparison, Confidences, HypothesisReading, ReadPayload, Target, Tested};
pub use code::{Code, Decoded, Layout, PAPER_LENGTHS, Payload, Scheme};
pub use decision::Decision;
pub use error::{Error, Result};
pub use hypothesis::{
    Hypothesis, NEXT_ESTIMATES, PhotometricCorrection, RegisteredTones, Tone, WINDOW_STEPS, Window, tint_without_ground,
};
pub use limits::{MAX_BITS, VERSION};
pub use message::{Message, MessageLength};
pub use message_code::MessageCode;
pub use reading::Reading;
pub use search::{Hit, Index};
pub use shares::shares;
pub use whiten::{Mark, NONCE_BYTES, Whitening, mark};
