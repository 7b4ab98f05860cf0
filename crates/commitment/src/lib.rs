//! Commitments: what a registry signs when an original is registered, and how anybody checks it.
//!
//! A [`Commitment`] binds an asset, its owner, the SHA-256 of the original, the key and the payload number that it is
//! marked with, and a nonce that stays secret, to a time. Its canonical bytes are hashed with SHA-256, the hash is
//! signed with Ed25519 ([`Signed`]), and each commitment holds the hash of the one before, so that a [`Chain`] shows
//! what was taken out, put in or dated back. The nonce is committed to through a hash with a random blinding; who
//! knows both can open it ([`Opening`]), now or in years, and show others ([`OpenedDocument`]).
//!
//! Nothing here reads a file, a clock or random numbers.
mod chain;
mod commitment;
mod document;
mod error;
mod key;
mod opened;
mod opening;
mod signed;

pub use chain::{Chain, Link};
pub use commitment::{CANONICAL_BYTES, Commitment, FIRST, Hash, VERSION};
pub use document::{Document, MAX_DOCUMENT_BYTES};
pub use error::{Error, Result};
pub use key::{PublicKey, SEED_BYTES, SigningKey};
pub use opened::OpenedDocument;
pub use opening::{BLINDING_BYTES, NONCE_BYTES, OPENING_BYTES, Opening};
pub use signed::{SIGNATURE_BYTES, Signed};

#[cfg(test)]
mod tests;
