//! What a mark says, how it is protected from errors, and the exact test that a copyright claim rests on.
//!
//! A [`Payload`] is packed into a codeword of a [`Code`]; the codeword is whitened by a secret pad ([`Whitening`]) and
//! embedded. What is read back are logits, summed per bit over views. A [`Claim`] compares the word that they decide for
//! with whitened words, and asks [`chance`] how likely so many matches are for a wrong key: error correction reads the
//! payload and never decides. [`Index`] finds the nearest of many registered words.
//!
//! Nothing here needs tensors, threads or files, so that server, worker and client all use the same code.
pub mod chance;
mod claim;
mod code;
mod error;
mod payload;
mod reading;
mod search;
mod whiten;
mod message;

pub use claim::{Answer, Claim, Comparison, Confidences, Framing, ReadPayload, Target, Tested, Verdict};
pub use code::{Code, Decoded, PAPER_LENGTHS, Scheme};
pub use error::{Error, Result};
pub use payload::{Layout, Payload, VERSION};
pub use reading::Reading;
pub use search::{Hit, Index};
pub use whiten::{Mark, NONCE_BYTES, Whitening, mark};
pub use message::{MAX_BITS, Word, WordLength};
