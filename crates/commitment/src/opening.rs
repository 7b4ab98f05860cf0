//! The secret nonce of an asset, and the blinding that keeps its hash from telling anything of it.
use std::fmt;

use secrecy::zeroize::Zeroizing;
use secrecy::{ExposeSecret, SecretBox};
use sha2::{Digest, Sha256};

use crate::{Error, Hash, Result};

/// Bytes of a nonce: 128 bits.
pub const NONCE_BYTES: usize = 16;
/// Bytes of a blinding.
pub const BLINDING_BYTES: usize = 32;
/// Bytes of both.
pub const OPENING_BYTES: usize = NONCE_BYTES + BLINDING_BYTES;

/// What the hash begins with, so that it is the hash of nothing else.
const PREFIX: &[u8] = b"guardsplat nonce\0";

/// A nonce and its blinding. `Debug` shows nothing of them, and they are wiped when dropped.
pub struct Opening {
    /// First the nonce, then the blinding.
    bytes: SecretBox<[u8; OPENING_BYTES]>,
}

impl Opening {
    /// From a nonce and, behind it, its blinding: [`OPENING_BYTES`] bytes, drawn at random.
    ///
    /// # Errors
    /// `NotAnOpening` for another number of bytes.
    pub fn new(bytes: &[u8]) -> Result<Self> {
        if bytes.len() != OPENING_BYTES {
            return Err(Error::NotAnOpening {
                found: bytes.len(),
                wanted: OPENING_BYTES,
            });
        }
        // Written in place, so that no copy is left behind.
        let mut kept = Box::new([0; OPENING_BYTES]);
        kept.copy_from_slice(bytes);
        Ok(Self {
            bytes: SecretBox::new(kept),
        })
    }

    /// The nonce.
    pub fn nonce(&self) -> &[u8] {
        &self.bytes()[..NONCE_BYTES]
    }

    /// The blinding.
    pub fn blinding(&self) -> &[u8] {
        &self.bytes()[NONCE_BYTES..]
    }

    /// Nonce and blinding, as [`Self::new`] takes them.
    pub fn bytes(&self) -> &[u8; OPENING_BYTES] {
        self.bytes.expose_secret()
    }

    /// What a commitment holds of the nonce: SHA-256 of a prefix, the blinding and the nonce.
    pub fn hash(&self) -> Hash {
        let mut hash = Sha256::new_with_prefix(PREFIX);
        hash.update(self.blinding());
        hash.update(self.nonce());
        hash.finalize().into()
    }
}

impl Opening {
    /// The secret of the pad that the asset's mark is under: SHA-256 of a prefix and the blinding, another value than
    /// the commitment's hash is made of, should one ever get out.
    pub fn whitening_secret(&self) -> Zeroizing<[u8; 32]> {
        let mut hash = Sha256::new_with_prefix(b"guardsplat whitening secret\0");
        hash.update(self.blinding());
        Zeroizing::new(hash.finalize().into())
    }
}

impl fmt::Debug for Opening {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Opening([REDACTED])")
    }
}
